//! Inputs of cases that are made: surfaces, and files that are no text.

use std::fs;
use std::path::Path;

type Triangle = [[f32; 3]; 3];

/// Surface of boxes of a grid, mm: `size` each, around `centre` for the one at the origin.
fn blocks(cells: &[[i8; 3]], size: [f32; 3], centre: [f32; 3]) -> Vec<Triangle> {
    let corner = |cell: [i8; 3], side: [bool; 3]| -> [f32; 3] {
        std::array::from_fn(|k| {
            centre[k] + size[k] * (f32::from(cell[k]) + if side[k] { 0.5 } else { -0.5 })
        })
    };
    let mut triangles = Vec::new();
    for &cell in cells {
        for axis in 0..3 {
            for high in [false, true] {
                let mut beside = cell;
                beside[axis] += if high { 1 } else { -1 };
                if cells.contains(&beside) {
                    continue;
                }
                let at = |u: bool, v: bool| {
                    let mut side = [high; 3];
                    side[(axis + 1) % 3] = u;
                    side[(axis + 2) % 3] = v;
                    corner(cell, side)
                };
                let square = [
                    at(false, false),
                    at(true, false),
                    at(true, true),
                    at(false, true),
                ];
                for [b, c] in [[1, 2], [2, 3]] {
                    let [b, c] = if high { [b, c] } else { [c, b] };
                    triangles.push([square[0], square[b], square[c]]);
                }
            }
        }
    }
    triangles
}

fn block(size: [f32; 3], centre: [f32; 3]) -> Vec<Triangle> {
    blocks(&[[0; 3]], size, centre)
}

/// As large as the shipped chest.
fn skin() -> Vec<Triangle> {
    block([320.0, 252.0, 400.0], [0.0; 3])
}

fn scaled(mut triangles: Vec<Triangle>, factor: f32) -> Vec<Triangle> {
    for number in triangles.as_flattened_mut().as_flattened_mut() {
        *number *= factor;
    }
    triangles
}

fn turned(mut triangles: Vec<Triangle>) -> Vec<Triangle> {
    for triangle in &mut triangles {
        triangle.swap(1, 2);
    }
    triangles
}

/// A binary STL file.
fn stl(triangles: &[Triangle]) -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend(u32::try_from(triangles.len()).unwrap().to_le_bytes());
    for triangle in triangles {
        bytes.extend([0; 12]);
        for number in triangle.as_flattened() {
            bytes.extend(number.to_le_bytes());
        }
        bytes.extend([0; 2]);
    }
    bytes
}

/// The shipped UR3 with every mass and moment of inertia at zero.
fn massless(urdf: &str) -> String {
    let zeroed = |line: &str| -> String {
        let trimmed = line.trim_start();
        if trimmed.starts_with("<mass ") {
            "<mass value=\"0\"/>".to_owned()
        } else if trimmed.starts_with("<inertia ") {
            "<inertia ixx=\"0\" ixy=\"0\" ixz=\"0\" iyy=\"0\" iyz=\"0\" izz=\"0\"/>".to_owned()
        } else {
            line.to_owned()
        }
    };
    let lines: Vec<String> = urdf.lines().map(zeroed).collect();
    lines.join("\n")
}

/// Surfaces by name: a sound phantom's, and those with one thing wrong with them.
fn surfaces() -> Vec<(&'static str, Vec<Triangle>)> {
    let mut open = skin();
    open.remove(0);
    let mut flat = skin();
    let [a, b, _] = flat[4];
    flat.insert(7, [a, b, b]);
    let mut double = skin();
    double.push(double[3]);
    let mut not_finite = skin();
    not_finite[2][1][0] = f32::NAN;
    // Two ridges with a furrow between them.
    let ridges = [[-1, 0, 0], [0, 0, 0], [1, 0, 0], [-1, -1, 0], [1, -1, 0]];
    vec![
        ("skin", skin()),
        ("bone", block([20.0, 20.0, 300.0], [0.0, 60.0, 0.0])),
        ("lesion", block([12.0; 3], [0.0, -60.0, 0.0])),
        ("open", open),
        ("inside_out", turned(skin())),
        ("flat", flat),
        ("double", double),
        ("not_finite", not_finite),
        ("centimetres", scaled(skin(), 0.1)),
        ("metres", scaled(skin(), 1e-3)),
        ("narrow", block([200.0, 252.0, 400.0], [0.0; 3])),
        // 5 mm into the bone, whose near face is at y = 50 mm.
        ("heart", block([10.0, 60.0, 60.0], [0.0, 25.0, 0.0])),
        (
            "bone_in_front",
            block([20.0, 20.0, 300.0], [0.0, -60.0, 0.0]),
        ),
        (
            "furrowed",
            blocks(&ridges, [100.0, 120.0, 300.0], [0.0, 60.0, 0.0]),
        ),
        ("lesion_in_ridge", block([12.0; 3], [100.0, -60.0, 0.0])),
    ]
}

/// Writes all of them into a folder.
pub fn write_into(folder: &Path, ur3: &str) {
    let write = |name: &str, bytes: &[u8]| fs::write(folder.join(name), bytes).unwrap();
    for (name, triangles) in surfaces() {
        write(&format!("{name}.stl"), &stl(&triangles));
    }
    write("collada.stl", b"<COLLADA/>");
    write("hello.urdf", b"hello");
    write("sdf.urdf", b"<sdf/>");
    write("bytes.urdf", b"\xff\xfe<");
    write("half.urdf", &ur3.as_bytes()[..ur3.len() / 2]);
    write("massless.urdf", massless(ur3).as_bytes());
    write("latin.toml", b"name = \"sm\xe4ll\"\n");
}
