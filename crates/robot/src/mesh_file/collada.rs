//! COLLADA files: the surfaces of the scene, each as often as it is placed.
//!
//! Of a file is read what solids are made of, by the tables of COLLADA 1.4.1 and 1.5. What would change a shape and is not
//! read is an error: skinned and morphed meshes, splines, faces with holes, skewed nodes, other files.

use std::collections::HashMap;

use nalgebra::{Matrix4, Point3, Rotation3, Unit, Vector3};
use roxmltree::{Document, Node};

use needlebench_geometry::mesh::MeshFileError;

use super::Surface;

/// Deepest nesting of nodes: one that places itself has no end.
const DEEPEST: usize = 64;

/// Most triangles of a scene: nodes that are placed again and again make many of few.
const MOST_TRIANGLES: usize = 20_000_000;

type Read<T> = Result<T, MeshFileError>;

/// Surface of a COLLADA file, m. The up axis that it states is not applied: the file's own axes are those of the link.
///
/// # Errors
/// Not well-formed, or something in it is not read.
pub(super) fn read(bytes: &[u8]) -> Read<Surface> {
    let text = std::str::from_utf8(bytes)
        .map_err(|error| MeshFileError::Malformed(format!("not UTF-8 text: {error}")))?;
    let document = Document::parse(text)
        .map_err(|error| MeshFileError::Malformed(format!("not well-formed XML: {error}")))?;
    let root = document.root_element();
    if root.tag_name().name() != "COLLADA" {
        let tag = root.tag_name().name();
        return Err(MeshFileError::Malformed(format!(
            "the root element is <{tag}>; of a COLLADA file it is <COLLADA>"
        )));
    }
    let identified = document
        .descendants()
        .filter_map(|node| Some((node.attribute("id")?, node)));
    let mut reader = Reader {
        document: &document,
        by_id: identified.collect(),
        surface: (Vec::new(), Vec::new()),
    };
    let metres = reader.unit_m(root)?;
    let unit = Matrix4::new_scaling(metres);
    let scene = child(root, "scene").and_then(|scene| child(scene, "instance_visual_scene"));
    let scene = match scene {
        Some(instance) => Some(reader.named(instance, "url")?),
        None => root
            .descendants()
            .find(|node| node.tag_name().name() == "visual_scene"),
    };
    if let Some(scene) = scene {
        reader.children(scene, &unit, 0)?;
    } else {
        // A library of shapes alone.
        let geometries = root
            .descendants()
            .filter(|node| node.tag_name().name() == "geometry");
        for geometry in geometries {
            reader.geometry(geometry, &unit)?;
        }
    }
    Ok(reader.surface)
}

struct Reader<'a, 'input> {
    document: &'a Document<'input>,
    by_id: HashMap<&'a str, Node<'a, 'input>>,
    surface: Surface,
}

fn child<'a, 'input>(node: Node<'a, 'input>, tag: &str) -> Option<Node<'a, 'input>> {
    elements(node).find(|each| each.tag_name().name() == tag)
}

fn elements<'a, 'input: 'a>(node: Node<'a, 'input>) -> impl Iterator<Item = Node<'a, 'input>> + 'a {
    node.children().filter(Node::is_element)
}

/// All text of an element: a comment within it parts it.
fn text(node: Node<'_, '_>) -> String {
    let parts = node.children().filter(Node::is_text);
    parts.filter_map(|part| part.text()).collect()
}

impl<'a, 'input> Reader<'a, 'input> {
    fn wrong(&self, node: Node<'_, '_>, what: impl std::fmt::Display) -> MeshFileError {
        let line = self.document.text_pos_at(node.range().start).row;
        MeshFileError::Malformed(format!("line {line}: {what}"))
    }

    fn unit_m(&self, root: Node<'a, 'input>) -> Read<f64> {
        let unit = child(root, "asset").and_then(|asset| child(asset, "unit"));
        let Some((unit, metres)) = unit.and_then(|unit| Some((unit, unit.attribute("meter")?)))
        else {
            return Ok(1.0);
        };
        match metres.trim().parse::<f64>() {
            Ok(metres) if metres.is_finite() && metres > 0.0 => Ok(metres),
            _ => Err(self.wrong(unit, format!("a unit of `{metres}` m"))),
        }
    }

    /// What an attribute `#id` names.
    fn named(&self, node: Node<'a, 'input>, attribute: &str) -> Read<Node<'a, 'input>> {
        let tag = node.tag_name().name();
        let url = node
            .attribute(attribute)
            .ok_or_else(|| self.wrong(node, format!("<{tag}> has no `{attribute}`")))?;
        let id = url.trim().strip_prefix('#').ok_or_else(|| {
            self.wrong(
                node,
                format!("`{url}` is in another file, which is not supported"),
            )
        })?;
        let found = self.by_id.get(id).copied();
        found.ok_or_else(|| self.wrong(node, format!("there is no `{id}`")))
    }

    fn numbers(&self, node: Node<'a, 'input>) -> Read<Vec<f64>> {
        text(node)
            .split_whitespace()
            .map(|word| {
                let number = word.parse::<f64>().ok().filter(|number| number.is_finite());
                number.ok_or_else(|| self.wrong(node, format!("`{word}` is not a finite number")))
            })
            .collect()
    }

    fn so_many<const N: usize>(&self, node: Node<'a, 'input>) -> Read<[f64; N]> {
        let numbers = self.numbers(node)?;
        let (tag, count) = (node.tag_name().name(), numbers.len());
        numbers
            .try_into()
            .map_err(|_| self.wrong(node, format!("<{tag}> has {count} numbers of {N}")))
    }

    fn indices(&self, node: Node<'a, 'input>) -> Read<Vec<usize>> {
        text(node)
            .split_whitespace()
            .map(|word| {
                let index = word.parse();
                index.map_err(|_| self.wrong(node, format!("`{word}` is not an index")))
            })
            .collect()
    }

    /// What a visual scene or a node places.
    fn children(&mut self, node: Node<'a, 'input>, outer: &Matrix4<f64>, depth: usize) -> Read<()> {
        if depth > DEEPEST {
            return Err(self.wrong(node, format!("nodes are nested deeper than {DEEPEST}")));
        }
        let mut here = *outer;
        for each in elements(node) {
            if let Some(transform) = self.transform(each)? {
                here *= transform;
            }
        }
        for each in elements(node) {
            match each.tag_name().name() {
                "node" => self.children(each, &here, depth + 1)?,
                "instance_node" => {
                    let named = self.named(each, "url")?;
                    self.children(named, &here, depth + 1)?;
                }
                "instance_geometry" => {
                    let geometry = self.named(each, "url")?;
                    self.geometry(geometry, &here)?;
                }
                "instance_controller" => {
                    return Err(self.wrong(each, "a skinned or morphed mesh is not supported"));
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn transform(&self, node: Node<'a, 'input>) -> Read<Option<Matrix4<f64>>> {
        Ok(Some(match node.tag_name().name() {
            "matrix" => Matrix4::from_row_slice(&self.so_many::<16>(node)?),
            "translate" => Matrix4::new_translation(&Vector3::from(self.so_many::<3>(node)?)),
            "scale" => Matrix4::new_nonuniform_scaling(&Vector3::from(self.so_many::<3>(node)?)),
            "rotate" => {
                let [x, y, z, degrees] = self.so_many::<4>(node)?;
                let axis = Unit::try_new(Vector3::new(x, y, z), 1e-12)
                    .ok_or_else(|| self.wrong(node, "a rotation without an axis"))?;
                Rotation3::from_axis_angle(&axis, degrees.to_radians()).to_homogeneous()
            }
            tag @ ("skew" | "lookat") => {
                return Err(self.wrong(node, format!("<{tag}> is not supported")));
            }
            _ => return Ok(None),
        }))
    }

    fn geometry(&mut self, geometry: Node<'a, 'input>, here: &Matrix4<f64>) -> Read<()> {
        let Some(mesh) = child(geometry, "mesh") else {
            return Err(self.wrong(geometry, "a <geometry> without a <mesh> is not supported"));
        };
        let is_mirrored = here.fixed_view::<3, 3>(0, 0).determinant() < 0.0;
        for primitive in elements(mesh) {
            let faces = match primitive.tag_name().name() {
                "triangles" => self.faces(primitive, |_, corners| {
                    Ok(corners.chunks(3).map(<[usize]>::to_vec).collect())
                })?,
                "polylist" => self.faces(primitive, Self::of_polylist)?,
                "polygons" => self.faces(primitive, |_, corners| Ok(vec![corners.to_vec()]))?,
                "tristrips" => self.faces(primitive, |_, strip| Ok(of_strip(strip)))?,
                "trifans" => self.faces(primitive, |_, fan| Ok(vec![fan.to_vec()]))?,
                "lines" | "linestrips" | "source" | "vertices" | "extra" => continue,
                tag => return Err(self.wrong(primitive, format!("<{tag}> is not supported"))),
            };
            let Some((corners, faces)) = faces else {
                continue;
            };
            let first =
                u32::try_from(self.surface.0.len()).map_err(|_| MeshFileError::TooManyVertices)?;
            let number = |corner: usize| {
                let corner = u32::try_from(corner).ok();
                corner
                    .and_then(|corner| first.checked_add(corner))
                    .ok_or(MeshFileError::TooManyVertices)
            };
            for face in faces {
                if face.len() < 3 {
                    let few = format!("a face has {} corners", face.len());
                    return Err(self.wrong(primitive, few));
                }
                if let Some(none) = face.iter().find(|&&corner| corner >= corners.len()) {
                    let there = format!("there is no corner {none} of {}", corners.len());
                    return Err(self.wrong(primitive, there));
                }
                for pair in face[1..].windows(2) {
                    let mut triangle = [number(face[0])?, number(pair[0])?, number(pair[1])?];
                    if is_mirrored {
                        triangle.swap(1, 2);
                    }
                    self.surface.1.push(triangle);
                }
                if self.surface.1.len() > MOST_TRIANGLES {
                    let many = format!("more than {MOST_TRIANGLES} triangles");
                    return Err(self.wrong(primitive, many));
                }
            }
            let placed = corners.iter().map(|corner| here.transform_point(corner));
            self.surface.0.extend(placed);
        }
        Ok(())
    }

    /// The corners that a primitive has and its faces, by what makes faces of the corners that a `<p>` lists.
    #[expect(clippy::type_complexity)]
    fn faces(
        &self,
        primitive: Node<'a, 'input>,
        of: impl Fn(&(&Self, Node<'a, 'input>), &[usize]) -> Read<Vec<Vec<usize>>>,
    ) -> Read<Option<(Vec<Point3<f64>>, Vec<Vec<usize>>)>> {
        let inputs = || elements(primitive).filter(|each| each.tag_name().name() == "input");
        let offset = |input: Node<'a, 'input>| {
            let offset = input.attribute("offset").unwrap_or("0");
            let offset = offset.trim().parse::<usize>().ok();
            offset
                .filter(|offset| *offset < 256)
                .ok_or_else(|| self.wrong(input, "its `offset` is not a small number"))
        };
        let mut stride = 1;
        for input in inputs() {
            stride = stride.max(offset(input)? + 1);
        }
        let lists: Vec<_> = elements(primitive)
            .filter(|each| matches!(each.tag_name().name(), "p" | "ph"))
            .collect();
        if lists.is_empty() {
            return Ok(None);
        }
        let vertex = inputs()
            .find(|input| input.attribute("semantic") == Some("VERTEX"))
            .ok_or_else(|| self.wrong(primitive, "no <input> has the semantic VERTEX"))?;
        let at = offset(vertex)?;
        let corners = self.corners(self.named(vertex, "source")?)?;
        let mut faces = Vec::new();
        for list in lists {
            if list.tag_name().name() == "ph" {
                return Err(self.wrong(list, "a face with holes is not supported"));
            }
            let indices = self.indices(list)?;
            if indices.len() % stride != 0 {
                let count = indices.len();
                let what = format!("{count} indices are not a multiple of the {stride} per vertex");
                return Err(self.wrong(list, what));
            }
            let of_corners: Vec<usize> = indices.chunks(stride).map(|each| each[at]).collect();
            faces.extend(of(&(self, primitive), &of_corners)?);
        }
        Ok(Some((corners, faces)))
    }

    fn of_polylist(
        (reader, primitive): &(&Self, Node<'a, 'input>),
        corners: &[usize],
    ) -> Read<Vec<Vec<usize>>> {
        let counts = child(*primitive, "vcount").map_or(Ok(Vec::new()), |at| reader.indices(at))?;
        let mut rest = corners;
        let mut faces = Vec::with_capacity(counts.len());
        for count in counts {
            let Some((face, others)) = rest.split_at_checked(count) else {
                return Err(reader.wrong(*primitive, "there are fewer corners than <vcount> says"));
            };
            faces.push(face.to_vec());
            rest = others;
        }
        if rest.is_empty() {
            Ok(faces)
        } else {
            Err(reader.wrong(*primitive, "there are more corners than <vcount> says"))
        }
    }

    /// Places of `<vertices>`, in the file's unit.
    fn corners(&self, vertices: Node<'a, 'input>) -> Read<Vec<Point3<f64>>> {
        let position = elements(vertices)
            .find(|input| input.attribute("semantic") == Some("POSITION"))
            .ok_or_else(|| self.wrong(vertices, "no <input> has the semantic POSITION"))?;
        let source = self.named(position, "source")?;
        let accessor = child(source, "technique_common").and_then(|it| child(it, "accessor"));
        let accessor = accessor.ok_or_else(|| self.wrong(source, "no <accessor>"))?;
        let whole = |name: &str, or: usize| match accessor.attribute(name) {
            None => Ok(or),
            Some(text) => text
                .trim()
                .parse::<usize>()
                .map_err(|_| self.wrong(accessor, format!("its `{name}` is `{text}`"))),
        };
        let (stride, offset) = (whole("stride", 1)?, whole("offset", 0)?);
        let params: Vec<_> = elements(accessor)
            .filter(|each| each.tag_name().name() == "param")
            .collect();
        // By name where there are names; else the first three.
        let axis = |name: &str, or: usize| {
            let found = params
                .iter()
                .position(|each| each.attribute("name") == Some(name));
            found.unwrap_or(or)
        };
        let axes = [axis("X", 0), axis("Y", 1), axis("Z", 2)];
        if stride <= axes.into_iter().max().unwrap_or(2) {
            return Err(self.wrong(accessor, format!("{stride} numbers are not a position")));
        }
        let numbers = self.numbers(self.named(accessor, "source")?)?;
        let there = numbers.get(offset..).unwrap_or_default();
        let count = whole("count", there.len() / stride)?;
        let places: Vec<_> = there
            .chunks_exact(stride)
            .take(count)
            .map(|each| Point3::from(axes.map(|axis| each[axis])))
            .collect();
        if places.len() == count {
            Ok(places)
        } else {
            let few = format!("{} of {count} positions given", places.len());
            Err(self.wrong(accessor, few))
        }
    }
}

/// Every other triangle of a strip is turned round.
fn of_strip(strip: &[usize]) -> Vec<Vec<usize>> {
    let triangles = strip.windows(3).enumerate();
    triangles
        .map(|(at, corners)| match at % 2 {
            0 => corners.to_vec(),
            _ => vec![corners[1], corners[0], corners[2]],
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use needlebench_geometry::TriangleMesh;
    use needlebench_geometry::mesh::{MeshFileError, check_closed, extent_m, volume_m3};

    use crate::mesh_file::{MeshFormat, read_mesh};

    /// A file with a cube of 100 in its unit, by what its faces are, its scene and its unit.
    fn cube(faces: &str, scene: &str, unit: &str) -> String {
        format!(
            "<?xml version=\"1.0\"?><COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4.1\">\
             <asset>{unit}<up_axis>Y_UP</up_axis></asset><library_geometries><geometry id=\"cube\"><mesh>\
             <source id=\"at\"><float_array id=\"numbers\" count=\"24\">0 0 0 100 0 0 100 100 0 0 100 0 0 0 100 \
             1e2 0 100 100 100 100 0 100 100</float_array><technique_common><accessor source=\"#numbers\" \
             count=\"8\" stride=\"3\"><param name=\"X\"/><param name=\"Y\"/><param name=\"Z\"/></accessor>\
             </technique_common></source><vertices id=\"corners\"><input semantic=\"POSITION\" source=\"#at\"/>\
             </vertices>{faces}</mesh></geometry></library_geometries>{scene}</COLLADA>"
        )
    }

    const POLYLIST: &str = "<polylist count=\"6\"><input semantic=\"NORMAL\" source=\"#none\" offset=\"0\"/>\
        <input semantic=\"VERTEX\" source=\"#corners\" offset=\"1\"/><vcount>4 4 4 4 4 4</vcount><p>\
        9 0 9 3 9 2 9 1 9 4 9 5 9 6 9 7 9 0 9 1 9 5 9 4 9 1 9 2 9 6 9 5 9 2 9 3 9 7 9 6 9 3 9 0 9 4 9 7</p></polylist>";

    /// The cube twice, in a node that turns, moves and mirrors, and in a node of a library.
    const SCENE: &str = "<library_nodes><node id=\"again\"><translate>200 0 0</translate><instance_geometry \
        url=\"#cube\"/></node></library_nodes><library_visual_scenes><visual_scene id=\"scene\"><node>\
        <rotate>0 0 1 90</rotate><node><scale>-1 1 1</scale><instance_geometry url=\"#cube\"/></node>\
        <instance_node url=\"#again\"/></node></visual_scene></library_visual_scenes><scene>\
        <instance_visual_scene url=\"#scene\"/></scene>";

    const MILLIMETRES: &str = "<unit name=\"millimeter\" meter=\"0.001\"/>";

    fn mesh(text: &str) -> Result<TriangleMesh, MeshFileError> {
        read_mesh(text.as_bytes(), MeshFormat::Collada, [1.0; 3])
    }

    #[test]
    fn what_a_scene_places_is_there_as_often_and_where_it_is_placed() {
        let mesh = mesh(&cube(POLYLIST, SCENE, MILLIMETRES)).unwrap();
        assert_eq!(mesh.triangles.len(), 24);
        assert!(check_closed(&mesh).is_ok());
        assert!((volume_m3(&mesh) - 2e-3).abs() < 1e-12);
        // By a quarter turn the first cube, mirrored to x from -100 to 0, comes to y from -100 to 0; the other, moved
        // by 200 along x, to y from 200 to 300.
        let [low, high] = extent_m(&mesh);
        for (found, known) in low
            .iter()
            .chain(high.iter())
            .zip([-0.1, -0.1, 0.0, 0.0, 0.3, 0.1])
        {
            assert!((found - known).abs() < 1e-12, "{low} {high}");
        }
    }

    #[test]
    fn every_kind_of_faces_makes_the_same_cube() {
        let input = "<input semantic=\"VERTEX\" source=\"#corners\" offset=\"0\"/>";
        let triangles = format!(
            "<triangles count=\"12\">{input}<p>0 3 2 0 2 1 4 5 6 4 6 7 0 1 5 0 5 4 1 2 6 1 6 5 2 3 7 2 7 6 3 0 4 3 4 7</p></triangles>"
        );
        let polygons = format!(
            "<polygons>{input}<p>0 3 2 1</p><p>4 5 6 7</p><p>0 1 5 4</p><p>1 2 6 5</p><p>2 3 7 6</p><p>3 0 4 7</p></polygons>"
        );
        let strips =
            format!("<tristrips>{input}<p>3 2 0 1 4 5 7 6</p><p>0 4 3 7 2 6 1 5</p></tristrips>");
        let fans = format!(
            "<trifans>{input}<p>0 3 2 1</p><p>4 5 6 7</p></trifans><polygons>{input}<p>0 1 5 4</p><p>1 2 6 5</p>\
             <p>2 3 7 6</p><p>3 0 4 7</p></polygons>"
        );
        let commented = triangles.replace(" 4 5 6 ", " <!-- the lid --> 4 5 6 ");
        for faces in [POLYLIST, &triangles, &polygons, &fans, &commented] {
            let mesh = mesh(&cube(faces, "", "")).unwrap();
            assert_eq!(mesh.triangles.len(), 12);
            assert!(check_closed(&mesh).is_ok(), "{faces}");
            assert!((volume_m3(&mesh) - 1e6).abs() < 1e-6);
        }
        let strips = mesh(&cube(&strips, "", "")).unwrap();
        assert_eq!(strips.triangles.len(), 12);
        assert!(check_closed(&strips).is_ok());
    }

    #[test]
    fn what_is_not_read_is_an_error_that_says_where() {
        let endless = SCENE.replace(
            "<instance_geometry url=\"#cube\"/></node></library_nodes>",
            "<instance_node url=\"#again\"/></node></library_nodes>",
        );
        let input = "<input semantic=\"VERTEX\" source=\"#corners\" offset=\"0\"/>";
        for (text, why) in [
            (String::from("<COLLADA"), "not well-formed"),
            (String::from("<robot/>"), "root element is <robot>"),
            (cube(POLYLIST, &endless, ""), "deeper than 64"),
            (
                cube(POLYLIST, &SCENE.replace("#cube", "#none"), ""),
                "there is no `none`",
            ),
            (
                cube(POLYLIST, &SCENE.replace("#cube", "other.dae#cube"), ""),
                "another file",
            ),
            (
                cube(
                    POLYLIST,
                    &SCENE.replace("instance_geometry", "instance_controller"),
                    "",
                ),
                "skinned",
            ),
            (
                cube(POLYLIST, &SCENE.replace("scale>", "skew>"), ""),
                "<skew> is not supported",
            ),
            (
                cube(POLYLIST, &SCENE.replace("-1 1 1<", "-1 1<"), ""),
                "2 numbers of 3",
            ),
            (cube(POLYLIST, "", "<unit meter=\"0\"/>"), "unit of `0` m"),
            (
                cube(&POLYLIST.replace("9 7</p>", "9 8</p>"), "", ""),
                "no corner 8 of 8",
            ),
            (
                cube(&POLYLIST.replace(" 4</vcount>", " 5</vcount>"), "", ""),
                "fewer corners",
            ),
            (
                cube(&POLYLIST.replace(" 4</vcount>", "</vcount>"), "", ""),
                "more corners",
            ),
            (
                cube(&POLYLIST.replace("9 7</p>", "9</p>"), "", ""),
                "not a multiple of the 2",
            ),
            (
                cube(
                    &format!("<polygons>{input}<ph><p>0 1 2</p></ph></polygons>"),
                    "",
                    "",
                ),
                "holes",
            ),
            (cube("<spline/>", "", ""), "<spline> is not supported"),
            (cube("", "", ""), "no triangles"),
            (
                cube(POLYLIST, "", "").replace("count=\"8\"", "count=\"9000000000\""),
                "8 of 9000000000",
            ),
            (
                cube(POLYLIST, "", "").replace("1e2", "nan"),
                "not a finite number",
            ),
        ] {
            let said = mesh(&text).expect_err(&text).to_string();
            assert!(said.contains(why), "{said}, not {why}");
        }
    }
}
