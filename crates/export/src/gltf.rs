//! The cell as a picture in space: binary glTF 2.0.

use std::collections::BTreeMap;

use nalgebra::{Translation3, UnitQuaternion};
use needlebench_bench::provenance::PROGRAM_VERSION;
use needlebench_cell::reason_in_words;
use needlebench_clearance::ClearanceModel;
use needlebench_geometry::{Shape, TriangleMesh};
use needlebench_kinematics::ik::Configuration;
use needlebench_kinematics::trajectory::JointTrajectory;
use needlebench_kinematics::{JOINT_COUNT, JOINT_NAMES, Joints, LINK_NAMES, Pose};
use needlebench_planning::Planner;
use needlebench_scenario::ResolvedScenario;
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use serde_json::{Value, json};

use crate::marks::{marks, people};
use crate::stl::single;
use crate::surfaces::{MergedSurface, surfaces_of_cell};
use crate::{ExportError, ExportedFile, MovesWith};

/// Time between two keys of an animation, s. Joints turn evenly between keys, which is off by at most an eighth of the
/// acceleration times this squared: 4e-5 rad at 3 rad/s^2.
const KEY_STEP_S: f64 = 0.01;
/// Radius of the body that stands for a person, and how much of the least stature it is tall, as on pages.
const PERSON_RADIUS_M: f64 = 0.12;
const PERSON_HEIGHT: f64 = 0.82;
/// Radius of a ball at a person's eyes, m.
const EYES_RADIUS_M: f64 = 0.045;
/// Colours of people: bodies and eyes.
const PERSON: [f32; 4] = [0.35, 0.42, 0.62, 0.28];
const EYES: [f32; 4] = [0.35, 0.42, 0.62, 1.0];
/// Fineness of people, m.
const CHORD_ERROR_M: f64 = 1e-3;

/// Which posture is shown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shown {
    /// The start posture.
    Start,
    /// Joint positions, rad.
    Joints(Joints),
    /// A feasible configuration of a goal, with its planned motion as an animation.
    Goal {
        /// Index of the goal.
        goal: usize,
        /// The configuration.
        configuration: Configuration,
    },
}

/// What a relative URI has no letters for (RFC 3986): all but its unreserved ones.
const RESERVED: &AsciiSet = &NON_ALPHANUMERIC
    .remove(b'-')
    .remove(b'.')
    .remove(b'_')
    .remove(b'~');

/// How a scene is packed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Packing {
    /// One binary file, `STEM.glb`.
    Binary,
    /// The scene as JSON, `STEM.gltf`, and its numbers beside it, `STEM.bin`.
    Separate,
}

/// The cell in a posture, packed: a node for each link, below the one that it turns on, with the surfaces of
/// pages. Metres, y up; scene coordinates are those of the scenario's world below the node `world`.
///
/// # Errors
/// [`ExportError::NoPosture`] for a configuration that does not reach the goal.
pub fn gltf(
    resolved: &ResolvedScenario,
    stem: &str,
    shown: &Shown,
    packing: Packing,
) -> Result<Vec<ExportedFile>, ExportError> {
    let posed = Posed::of(resolved, shown)?;
    let mut scene = Scene::default();
    scene.cell(resolved, &posed);
    if let Some(motion) = &posed.motion {
        scene.animate(resolved, motion);
    }
    let mut extras = json!({
        "scenario": resolved.scenario.name,
        "scenario_sha256": resolved.source.sha256,
        "program": format!("needlebench {PROGRAM_VERSION}"),
        "arm": resolved.robot_description.arm_name.clone(),
        "tool": resolved.cell.tool.name,
        "joint_names": JOINT_NAMES,
        "joint_positions_rad": <[f64; JOINT_COUNT]>::from(posed.joints),
        "units": "m, y up; below the node world: z up, as the scenario",
        "notes": resolved.notes,
    });
    if let Shown::Goal {
        goal,
        configuration,
    } = shown
    {
        extras["goal"] = json!(resolved.goals[*goal].name);
        extras["configuration"] = json!(configuration.label());
        extras["planned"] = json!(posed.broken_rules.is_empty() && posed.motion.is_some());
        extras["broken_rules"] = json!(posed.broken_rules);
    }
    Ok(match packing {
        Packing::Binary => vec![ExportedFile {
            name: format!("{stem}.glb"),
            bytes: scene.binary(&extras),
        }],
        Packing::Separate => scene.separate(&extras, stem),
    })
}

/// A posture, and how the arm gets there.
struct Posed {
    joints: Joints,
    /// Goal of whose people are shown, if it is known.
    goal: Option<usize>,
    motion: Option<JointTrajectory>,
    /// Rules that the configuration violates, in words.
    broken_rules: Vec<String>,
}

impl Posed {
    fn of(resolved: &ResolvedScenario, shown: &Shown) -> Result<Self, ExportError> {
        let still = |joints| Self {
            joints,
            goal: None,
            motion: None,
            broken_rules: Vec::new(),
        };
        let (goal, configuration) = match shown {
            Shown::Start => return Ok(still(resolved.start)),
            Shown::Joints(joints) => return Ok(still(*joints)),
            Shown::Goal {
                goal,
                configuration,
            } => (*goal, *configuration),
        };
        let model = ClearanceModel::new(&resolved.cell);
        let planner = Planner::new(resolved, &model)?;
        let plan = planner.plan_one(&resolved.goals[goal], configuration);
        let rules = plan.rejections.iter();
        let broken_rules: Vec<String> = rules
            .map(|rejection| reason_in_words(rejection.rule.name()))
            .collect();
        let Some(candidate) = plan.candidate else {
            return Err(ExportError::NoPosture {
                goal: resolved.goals[goal].name.clone(),
                configuration: configuration.label(),
                reason: broken_rules.join(", "),
            });
        };
        Ok(Self {
            joints: candidate.joints,
            goal: Some(goal),
            motion: plan.trajectory,
            broken_rules,
        })
    }
}

#[derive(Default)]
struct Scene {
    nodes: Vec<Value>,
    /// Children by node.
    children: BTreeMap<usize, Vec<usize>>,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    material_of: Vec<[f32; 4]>,
    accessors: Vec<Value>,
    views: Vec<Value>,
    bytes: Vec<u8>,
    animation: Option<Value>,
    /// Nodes of the six links.
    links: Vec<usize>,
}

impl Scene {
    fn cell(&mut self, resolved: &ResolvedScenario, posed: &Posed) {
        let robot = &resolved.cell.robot;
        // z up to y up: a quarter turn about x.
        let y_up_from_world = Pose::rotation(nalgebra::Vector3::x() * -std::f64::consts::FRAC_PI_2);
        let world = self.node("world", None, &y_up_from_world);
        let base = self.node("base_link", Some(world), &robot.world_from_base_link);
        let mut parent = base;
        for i in 0..JOINT_COUNT {
            let joint = &robot.chain.joints[i];
            let turned = joint.parent_from_joint * turn(joint.axis, posed.joints[i]);
            let node = self.node(LINK_NAMES[i], Some(parent), &turned);
            let limit = &robot.limits.0[i];
            let finite = |value: f64| value.is_finite().then_some(value);
            self.nodes[node]["extras"] = json!({
                "joint": JOINT_NAMES[i],
                "axis": <[f64; 3]>::from(joint.axis.into_inner()),
                "position_rad": posed.joints[i],
                "lower_rad": finite(limit.lower_rad),
                "upper_rad": finite(limit.upper_rad),
            });
            self.links.push(node);
            parent = node;
        }
        let flange = self.node("tool0", Some(parent), &robot.chain.wrist_3_from_flange);
        for mark in marks(resolved) {
            let parent = match mark.frame {
                MovesWith::Flange => flange,
                MovesWith::Link(link) => self.links[link],
                MovesWith::World | MovesWith::Base => world,
            };
            self.node(&mark.name, Some(parent), &mark.place);
        }
        self.surfaces(resolved, [world, base, flange]);
        self.people(resolved, posed, world);
    }

    /// Surfaces by what they are of: links on their nodes, all else on nodes of their own.
    fn surfaces(&mut self, resolved: &ResolvedScenario, [world, base, flange]: [usize; 3]) {
        let base_from_world = resolved.cell.robot.world_from_base_link.inverse();
        let here = Pose::identity();
        let mut by_node: Vec<((usize, &'static str), Vec<MergedSurface>)> = Vec::new();
        for mut surface in surfaces_of_cell(resolved).0 {
            let node = match (surface.frame, surface.group) {
                // Shapes that are calculated with are in the formats of models.
                (_, "collision") => continue,
                (MovesWith::Base, "robot") => {
                    for vertex in &mut surface.mesh.vertices_m {
                        *vertex = base_from_world * *vertex;
                    }
                    (base, "")
                }
                (MovesWith::Link(link), "robot") => (self.links[link], ""),
                (MovesWith::Link(link), group) => (self.links[link], group),
                (MovesWith::Flange, group) => (flange, group),
                (MovesWith::Base | MovesWith::World, group) => (world, group),
            };
            match by_node.iter_mut().find(|(known, _)| *known == node) {
                Some((_, surfaces)) => surfaces.push(surface),
                None => by_node.push((node, vec![surface])),
            }
        }
        for ((parent, group), surfaces) in by_node {
            let node = match group {
                "" => parent,
                "corridor" => self.node("needle_corridor", Some(parent), &here),
                group => self.node(group, Some(parent), &here),
            };
            let parts = surfaces.iter();
            let parts: Vec<_> = parts.map(|each| (&each.mesh, each.color_rgba)).collect();
            self.show(node, &parts);
        }
    }

    /// People where they stand, if it is known while which goal is served, or all the same.
    fn people(&mut self, resolved: &ResolvedScenario, posed: &Posed, world: usize) {
        let all = &resolved.people.by_goal;
        let same = all.windows(2).all(|pair| pair[0] == pair[1]);
        let Some(goal) = posed.goal.or(same.then_some(0)) else {
            return;
        };
        for person in people(resolved, goal) {
            let shortest_m = person.statures_m.iter().copied().fold(f64::MAX, f64::min);
            let height_m = PERSON_HEIGHT * shortest_m;
            let body = Shape::Capsule {
                radius_m: PERSON_RADIUS_M,
                half_length_m: (0.5 * height_m - PERSON_RADIUS_M).max(0.0),
            };
            let mut body = body.surface(CHORD_ERROR_M);
            for vertex in &mut body.vertices_m {
                vertex.z += 0.5 * height_m;
            }
            let eyes = Shape::Sphere {
                radius_m: EYES_RADIUS_M,
            };
            let balls = person.statures_m.iter().map(|&stature_m| {
                let mut ball = eyes.surface(CHORD_ERROR_M);
                let shift = person.eyes_m(stature_m) - person.position_m;
                for vertex in &mut ball.vertices_m {
                    *vertex += shift;
                }
                ball
            });
            let balls: Vec<TriangleMesh> = balls.collect();
            let mut parts = vec![(&body, PERSON)];
            parts.extend(balls.iter().map(|ball| (ball, EYES)));
            let place = Translation3::from(person.position_m).into();
            let node = self.node(&person.name, Some(world), &place);
            self.show(node, &parts);
        }
    }

    /// Adds a node at a place of its parent.
    fn node(&mut self, name: &str, parent: Option<usize>, parent_from_node: &Pose) -> usize {
        let mut node = json!({"name": name});
        if parent_from_node.translation != Translation3::identity() {
            let at: [f64; 3] = parent_from_node.translation.vector.into();
            node["translation"] = json!(at.map(|value| value + 0.0));
        }
        if parent_from_node.rotation != UnitQuaternion::identity() {
            node["rotation"] = json!(quaternion(&parent_from_node.rotation));
        }
        let index = self.nodes.len();
        self.nodes.push(node);
        if let Some(parent) = parent {
            self.children.entry(parent).or_default().push(index);
        }
        index
    }

    /// Gives a node surfaces, each with its colour.
    fn show(&mut self, node: usize, parts: &[(&TriangleMesh, [f32; 4])]) {
        let mut primitives = Vec::new();
        for (mesh, color_rgba) in parts {
            if mesh.triangles.is_empty() {
                continue;
            }
            let points: Vec<[f32; 3]> = mesh
                .vertices_m
                .iter()
                .map(|vertex| [vertex.x, vertex.y, vertex.z].map(single))
                .collect();
            let position = self.points(&points);
            let indices = self.indices(&mesh.triangles);
            let material = self.material(*color_rgba);
            primitives.push(json!({
                "attributes": {"POSITION": position},
                "indices": indices,
                "material": material,
            }));
        }
        if primitives.is_empty() {
            return;
        }
        let name = self.nodes[node]["name"].clone();
        self.nodes[node]["mesh"] = json!(self.meshes.len());
        self.meshes
            .push(json!({"name": name, "primitives": primitives}));
    }

    /// Colours are sRGB here and in proportion to light there.
    fn material(&mut self, color_rgba: [f32; 4]) -> usize {
        if let Some(known) = self
            .material_of
            .iter()
            .position(|known| *known == color_rgba)
        {
            return known;
        }
        let [red, green, blue, opacity] = color_rgba.map(f64::from);
        let [red, green, blue] = [red, green, blue].map(light);
        let mut material = json!({
            "pbrMetallicRoughness": {
                "baseColorFactor": [red, green, blue, opacity],
                "metallicFactor": 0.0,
                "roughnessFactor": 0.7,
            },
        });
        if opacity < 1.0 {
            material["alphaMode"] = json!("BLEND");
            material["doubleSided"] = json!(true);
        }
        self.materials.push(material);
        self.material_of.push(color_rgba);
        self.materials.len() - 1
    }

    fn points(&mut self, points: &[[f32; 3]]) -> usize {
        let (mut low, mut high) = ([f32::MAX; 3], [f32::MIN; 3]);
        for point in points {
            for axis in 0..3 {
                low[axis] = low[axis].min(point[axis]);
                high[axis] = high[axis].max(point[axis]);
            }
        }
        let bytes = points.iter().flatten().flat_map(|x| x.to_le_bytes());
        let view = self.view(bytes.collect(), Some(ARRAY));
        self.accessor(
            json!({
                "componentType": FLOAT,
                "type": "VEC3",
                "min": low.map(f64::from),
                "max": high.map(f64::from),
            }),
            view,
            points.len(),
        )
    }

    fn indices(&mut self, triangles: &[[u32; 3]]) -> usize {
        let bytes = triangles.iter().flatten().flat_map(|x| x.to_le_bytes());
        let view = self.view(bytes.collect(), Some(ELEMENTS));
        let kind = json!({"componentType": UNSIGNED_INT, "type": "SCALAR"});
        self.accessor(kind, view, 3 * triangles.len())
    }

    fn accessor(&mut self, mut kind: Value, view: usize, count: usize) -> usize {
        kind["bufferView"] = json!(view);
        kind["count"] = json!(count);
        self.accessors.push(kind);
        self.accessors.len() - 1
    }

    fn view(&mut self, bytes: Vec<u8>, target: Option<u32>) -> usize {
        let mut view = json!({
            "buffer": 0,
            "byteOffset": self.bytes.len(),
            "byteLength": bytes.len(),
        });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        // Everything is of four bytes each.
        self.bytes.extend(bytes);
        self.views.push(view);
        self.views.len() - 1
    }

    /// The motion as rotations of the links.
    fn animate(&mut self, resolved: &ResolvedScenario, motion: &JointTrajectory) {
        let duration_s = motion.duration_s();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a motion has some thousand keys"
        )]
        let steps = (duration_s / KEY_STEP_S).ceil().max(1.0) as usize;
        let times_s: Vec<f64> = (0..=steps)
            .map(|step| duration_s * (step as f64 / steps as f64))
            .collect();
        let bytes = times_s.iter().flat_map(|time| single(*time).to_le_bytes());
        let view = self.view(bytes.collect(), None);
        let input = self.accessor(
            json!({
                "componentType": FLOAT,
                "type": "SCALAR",
                "min": [0.0],
                "max": [f64::from(single(duration_s))],
            }),
            view,
            times_s.len(),
        );
        let (mut samplers, mut channels) = (Vec::new(), Vec::new());
        for i in 0..JOINT_COUNT {
            let joint = &resolved.cell.robot.chain.joints[i];
            let mut bytes = Vec::new();
            for &time_s in &times_s {
                let position = motion.sample(time_s).position[i];
                let turned = joint.parent_from_joint * turn(joint.axis, position);
                for value in quaternion(&turned.rotation) {
                    bytes.extend(single(value).to_le_bytes());
                }
            }
            let view = self.view(bytes, None);
            let kind = json!({"componentType": FLOAT, "type": "VEC4"});
            let output = self.accessor(kind, view, times_s.len());
            channels.push(json!({
                "sampler": i,
                "target": {"node": self.links[i], "path": "rotation"},
            }));
            samplers.push(json!({"input": input, "output": output, "interpolation": "LINEAR"}));
        }
        self.animation = Some(json!({
            "name": "planned motion",
            "channels": channels,
            "samplers": samplers,
        }));
    }

    /// Two files: the scene as JSON, and the numbers.
    fn separate(mut self, extras: &Value, stem: &str) -> Vec<ExportedFile> {
        let mut scene = self.described(extras);
        let numbers = format!("{stem}.bin");
        // A path of another file in JSON is a URI.
        scene["buffers"][0]["uri"] = json!(utf8_percent_encode(&numbers, RESERVED).to_string());
        vec![
            ExportedFile::text(format!("{stem}.gltf"), scene.to_string()),
            ExportedFile {
                name: numbers,
                bytes: self.bytes,
            },
        ]
    }

    /// The scene as JSON, but for where its numbers are.
    fn described(&mut self, extras: &Value) -> Value {
        for (node, children) in &self.children {
            self.nodes[*node]["children"] = json!(children);
        }
        let mut scene = json!({
            "asset": {"version": "2.0", "generator": format!("needlebench {PROGRAM_VERSION}"), "extras": extras},
            "scene": 0,
            "scenes": [{"name": extras["scenario"], "nodes": [0]}],
            "nodes": self.nodes,
            "meshes": self.meshes,
            "materials": self.materials,
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": self.bytes.len()}],
        });
        if let Some(animation) = &self.animation {
            scene["animations"] = json!([animation]);
        }
        scene
    }

    /// One file: a head, the scene as JSON, and the numbers.
    fn binary(mut self, extras: &Value) -> Vec<u8> {
        let mut text = self.described(extras).to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let length = |bytes: usize| {
            u32::try_from(bytes)
                .expect("scenes are far below 4 GB")
                .to_le_bytes()
        };
        let mut file = Vec::new();
        file.extend(b"glTF");
        file.extend(2_u32.to_le_bytes());
        file.extend(length(12 + 8 + text.len() + 8 + self.bytes.len()));
        for (kind, bytes) in [(b"JSON", &text), (b"BIN\0", &self.bytes)] {
            file.extend(length(bytes.len()));
            file.extend(kind);
            file.extend(bytes);
        }
        file
    }
}

/// Numbers of the format.
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY: u32 = 34962;
const ELEMENTS: u32 = 34963;

fn turn(axis: nalgebra::UnitVector3<f64>, angle_rad: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&axis, angle_rad)
}

/// x, y, z, w.
fn quaternion(rotation: &UnitQuaternion<f64>) -> [f64; 4] {
    let q: [f64; 4] = rotation.coords.into();
    q.map(|value| value + 0.0)
}

/// The light of an sRGB value, 0 to 1 (IEC 61966-2-1).
fn light(value: f64) -> f64 {
    let value = value.clamp(0.0, 1.0);
    if value <= 0.04045 {
        value / 12.92
    } else {
        libm::pow((value + 0.055) / 1.055, 2.4)
    }
}
