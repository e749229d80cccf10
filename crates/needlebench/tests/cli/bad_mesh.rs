//! Phantom parts from STL files: sound ones, and those that are refused with what is wrong where.

use crate::support::{Answer, Bench, Finding, SMALL, with_edit};

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

fn bone() -> Vec<Triangle> {
    block([20.0, 20.0, 300.0], [0.0, 60.0, 0.0])
}

fn lesion() -> Vec<Triangle> {
    block([12.0, 12.0, 12.0], [0.0, -60.0, 0.0])
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

/// The goal of `SMALL` by flange pose.
const FLANGE_POSE: &str = "\
insertion_length_mm = 86
approach_mm = 20
[goals.flange_pose]
position_mm = [194.2, -359.3, 170.1]
rotation_vector_rad = [-0.8567, 2.7197, -1.1407]
";

const PARTS: &str = "\
[[phantom.parts]]
name = \"body\"
file = \"skin.stl\"
tissue = \"skin\"
[[phantom.parts]]
name = \"spine\"
file = \"bone.stl\"
tissue = \"bone\"
[[phantom.parts]]
name = \"nodule\"
file = \"lesion.stl\"
tissue = \"lesion\"
";

/// A phantom of three files, and a needle straight down into the lesion.
fn scenario() -> String {
    let text = with_edit(SMALL, "[phantom]\n", "[phantom]\nmodel = \"none\"\n");
    let goal = "entry_mm = [0, -126, 0]\nlesion = \"nodule\"\n";
    let text = with_edit(&text, FLANGE_POSE, goal);
    // Out of reach, which is no matter of meshes.
    let text = with_edit(
        &text,
        "[criteria]\n",
        "[criteria]\nmin_working_configurations = 0\n",
    );
    with_edit(&text, "[table]", &format!("{PARTS}[table]"))
}

fn bench(text: &str) -> Bench {
    let bench = Bench::with_scenario(text);
    for (name, triangles) in [("skin", skin()), ("bone", bone()), ("lesion", lesion())] {
        bench.write(&format!("{name}.stl"), stl(&triangles));
    }
    bench
}

fn check(bench: &Bench) -> Answer {
    bench.run(&["check", "s.toml", "--json"])
}

#[track_caller]
fn refused(text: &str, files: &[(&str, &[Triangle])]) -> Finding {
    let bench = bench(text);
    for (name, triangles) in files {
        bench.write(name, stl(triangles));
    }
    Finding::only(&check(&bench).exits_with(2), text).in_file("s.toml")
}

#[track_caller]
fn refused_with(from: &str, to: &str) -> Finding {
    refused(&with_edit(&scenario(), from, to), &[])
}

/// What is wrong with the skin's file.
#[track_caller]
fn refused_skin(triangles: &[Triangle]) -> Finding {
    refused(&scenario(), &[("skin.stl", triangles)])
        .key("phantom.parts[0].file")
        .at("file = \"skin.stl\"")
        .says("skin.stl")
}

#[test]
fn phantom_of_files_alone_is_sound_before_it_is_spoilt() {
    let answer = check(&bench(&scenario())).exits_with(0).json();
    let notes = answer["notes"].to_string();
    assert!(notes.contains("part `body` is convex"), "{notes}");
}

#[test]
fn files_are_part_of_the_provenance_and_the_needle_keeps_from_the_bone() {
    let bench = bench(&scenario());
    bench.run(&["run", "s.toml", "--engine", "rapier"]);
    let report = bench.read_json("out/small/report.json");
    let inputs = report["provenance"]["inputs"].as_array().unwrap();
    let parts: Vec<&str> = inputs
        .iter()
        .filter(|input| input["role"] == "phantom part")
        .map(|input| input["file"].as_str().unwrap())
        .collect();
    assert_eq!(parts, ["skin.stl", "bone.stl", "lesion.stl"]);
    let goal = &report["goals"][0];
    assert_eq!(goal["lesion"], "nodule");
    let route = &goal["configurations"][0]["clearance"]["needle_route"];
    assert_eq!(route["pair"][1], "spine");
    // From the tip at y = -60 mm to the bone's face at y = 50 mm, less a half of 1.27 mm.
    let route_m = route["minimum_m"].as_f64().unwrap();
    assert!((route_m - (0.110 - 0.635e-3)).abs() < 1e-6, "{route_m}");
}

#[test]
fn open_surface_is_refused_with_the_number_of_edges_and_the_place() {
    let mut open = skin();
    open.remove(0);
    refused_skin(&open)
        .says("part `body`: the surface is open: 3 of its edges")
        .says("the first of them at [")
        .hints("close the holes");
}

#[test]
fn surface_inside_out_is_refused_and_may_be_turned() {
    refused_skin(&turned(skin()))
        .says("inside out")
        .hints("flip = true");
    let text = with_edit(
        &scenario(),
        "file = \"skin.stl\"\n",
        "file = \"skin.stl\"\nflip = true\n",
    );
    refused(&text, &[])
        .says("inside out")
        .hints("leave `flip` out");
    let bench = bench(&text);
    bench.write("skin.stl", stl(&turned(skin())));
    check(&bench).exits_with(0);
}

#[test]
fn triangle_without_area_is_refused_with_its_number() {
    let mut flat = skin();
    let [a, b, _] = flat[4];
    flat.insert(7, [a, b, b]);
    refused_skin(&flat)
        .says("triangle 7 at [")
        .says("has no area")
        .hints("Zero Area");
}

#[test]
fn triangle_given_twice_is_refused_with_both_numbers() {
    let mut double = skin();
    double.push(double[3]);
    refused_skin(&double)
        .says("triangles 3 and 12 have the same")
        .hints("Duplicate");
}

#[test]
fn coordinates_that_are_no_numbers_are_refused() {
    let mut bad = skin();
    bad[2][1][0] = f32::NAN;
    refused_skin(&bad).says("not finite");
}

#[test]
fn unit_is_guessed_from_the_size_and_not_assumed() {
    refused_skin(&scaled(skin(), 0.1))
        .says("in millimetres the part is 32.0 x 25.2 x 40.0 mm")
        .says("a skin is 120 to 2200 mm")
        .says("it looks like centimetres (320 x 252 x 400 mm)")
        .hints("set unit = \"cm\"");
    refused_skin(&scaled(skin(), 1e-3)).hints("set unit = \"m\"");
    let text = with_edit(
        &scenario(),
        "file = \"skin.stl\"\n",
        "file = \"skin.stl\"\nunit = \"cm\"\n",
    );
    let in_cm = bench(&text);
    in_cm.write("skin.stl", stl(&scaled(skin(), 0.1)));
    check(&in_cm).exits_with(0);
    // The unit that is stated is to blame, where one is.
    refused(&text, &[])
        .key("phantom.parts[0].unit")
        .hints("set unit = \"mm\"");
    refused_with("tissue = \"skin\"\n", "tissue = \"skin\"\nunit = \"ft\"\n")
        .key("phantom.parts[0].unit")
        .hints("mm, cm, m, in");
}

#[test]
fn file_that_is_missing_or_no_stl_is_refused() {
    refused_with("file = \"bone.stl\"", "file = \"bones.stl\"")
        .key("phantom.parts[1].file")
        .says("bones.stl")
        .hints("relative to the scenario");
    let text = scenario();
    let bench = bench(&text);
    bench.write("bone.stl", b"<COLLADA/>");
    Finding::only(&check(&bench).exits_with(2), &text)
        .key("phantom.parts[1].file")
        .at("file = \"bone.stl\"")
        .hints("an STL file");
}

#[test]
fn part_outside_the_skin_is_refused_with_how_far() {
    let at = "[0, 0, 120]";
    refused_with(
        "file = \"bone.stl\"\n",
        &format!("file = \"bone.stl\"\nposition_mm = {at}\n"),
    )
    .says("bone `spine` sticks 70.0 mm out of the skin")
    .hints("files of one scan share them");
}

#[test]
fn parts_of_the_model_that_do_not_fit_into_the_users_skin_are_named() {
    let text = with_edit(&scenario(), "model = \"none\"", "model = \"male-p50\"");
    let text = with_edit(
        &text,
        "tissue = \"skin\"\n",
        "tissue = \"skin\"\nreplaces = [\"skin\", \"spine\"]\n",
    );
    let small = block([200.0, 252.0, 400.0], [0.0; 3]);
    refused(&text, &[("skin.stl", &small)])
        .key("phantom.parts[0]")
        .says("the model's")
        .says("out of the skin")
        .hints("model = \"none\"");
}

#[test]
fn organs_that_overlap_are_noted_with_how_far() {
    let text = scenario()
        + "[[phantom.parts]]\nname = \"heart\"\nfile = \"heart.stl\"\ntissue = \"organ\"\n";
    let bench = bench(&text);
    // 5 mm into the bone, whose near face is at y = 50 mm.
    bench.write(
        "heart.stl",
        stl(&block([10.0, 60.0, 60.0], [0.0, 25.0, 0.0])),
    );
    let notes = check(&bench).exits_with(0).json()["notes"].to_string();
    assert!(
        notes.contains("parts `spine` and `heart` overlap: a corner of one is 5.0 mm inside"),
        "{notes}"
    );
}

#[test]
fn target_inside_a_bone_is_refused_unless_it_is_a_lesion() {
    let aimed = |target: &str| {
        with_edit(
            &scenario(),
            "lesion = \"nodule\"\n",
            &format!("target_mm = {target}\n"),
        )
    };
    let bone = block([20.0, 20.0, 300.0], [0.0, -60.0, 0.0]);
    refused(&aimed("[0, -60, 10]"), &[("bone.stl", &bone)])
        .key("goals[0].target_mm")
        .at("target_mm")
        .says("the target lies inside the bone `spine`")
        .hints("make it a lesion");
    let with_lesion = bench(&scenario());
    with_lesion.write("bone.stl", stl(&bone));
    check(&with_lesion).exits_with(0);
}

#[test]
fn needle_that_would_leave_the_skin_on_its_way_is_refused() {
    // Two ridges with a furrow between them.
    let cells = [[-1, 0, 0], [0, 0, 0], [1, 0, 0], [-1, -1, 0], [1, -1, 0]];
    let furrowed = blocks(&cells, [100.0, 120.0, 300.0], [0.0, 60.0, 0.0]);
    let lesion = block([12.0; 3], [100.0, -60.0, 0.0]);
    let text = with_edit(
        &scenario(),
        "entry_mm = [0, -126, 0]",
        "entry_mm = [-150, -60, 0]",
    );
    let files: [(&str, &[Triangle]); 2] = [("skin.stl", &furrowed), ("lesion.stl", &lesion)];
    refused(&text, &files)
        .key("goals[0].entry_mm")
        .says("leave the skin 100.0 mm after its entry and pierce it again");
    // From above it enters once.
    let text = with_edit(
        &scenario(),
        "entry_mm = [0, -126, 0]",
        "entry_mm = [100, -119, 0]",
    );
    let sound = bench(&text);
    for (name, triangles) in files {
        sound.write(name, stl(triangles));
    }
    let notes = check(&sound).exits_with(0).json()["notes"].to_string();
    assert!(notes.contains("moved -1.000 mm"), "{notes}");
}

#[test]
fn phantom_has_one_skin() {
    refused_with("tissue = \"skin\"", "tissue = \"organ\"").says("no skin");
    refused_with("tissue = \"bone\"", "tissue = \"skin\"").says("two parts are the skin");
    refused_with("model = \"none\"", "model = \"male-p50\"")
        .key("phantom.parts[0].tissue")
        .says("the model has a skin already")
        .hints("replaces = [\"skin\"]");
}

#[test]
fn names_of_parts_and_of_what_they_replace_are_checked() {
    refused_with("name = \"spine\"", "name = \"body\"")
        .key("phantom.parts[1].name")
        .says("another part `body`");
    refused_with("name = \"spine\"", "name = \"the spine\"").says("not a usable name");
    let text = with_edit(&scenario(), "model = \"none\"", "model = \"male-p50\"");
    let text = with_edit(
        &text,
        "tissue = \"skin\"\n",
        "tissue = \"skin\"\nreplaces = [\"skni\"]\n",
    );
    refused(&text, &[])
        .key("phantom.parts[0].replaces[0]")
        .says("the model has no part `skni`")
        .hints("did you mean `skin`?");
    refused_with("lesion = \"nodule\"", "lesion = \"nodul\"").hints("did you mean `nodule`?");
}

#[test]
fn size_of_a_model_contradicts_a_phantom_without_one() {
    refused_with("model = \"none\"", "model = \"none\"\ndepth_mm = 250")
        .key("phantom.depth_mm")
        .says("contradicts `model = \"none\"`");
}

#[test]
fn head_and_arms_of_a_phantom_without_a_model_are_refused() {
    for (key, limbs) in [("head", "head = true"), ("arms", "arms = \"overhead\"")] {
        refused_with("model = \"none\"", &format!("model = \"none\"\n{limbs}"))
            .key(&format!("phantom.{key}"))
            .says("has no size")
            .hints("name a model");
    }
}
