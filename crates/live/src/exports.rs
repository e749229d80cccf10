//! What a page calls: functions of numbers, and one memory.
//!
//! The page requests memory, writes bytes or numbers there, calls a function, and reads as many numbers as it
//! returned at `results`, or the bytes of a text at `message`.
#![expect(
    unsafe_code,
    reason = "a function is exported under its own name by the attribute `no_mangle` alone, which counts as \
              unsafe because two functions might have one name; there is no unsafe block here"
)]

use std::cell::RefCell;

use needlebench_clearance::PairClearance;
use needlebench_kinematics::Joints;
use needlebench_scenario::pose_of;

use crate::live::Live;
use crate::scene::Scene;

#[derive(Default)]
struct State {
    input: Vec<u8>,
    results: Vec<f64>,
    message: String,
    live: Option<Live>,
}

thread_local! {
    static STATE: RefCell<State> = RefCell::default();
}

impl State {
    /// The input as numbers.
    fn numbers<const N: usize>(&self) -> [f64; N] {
        let (chunks, _) = self.input.as_chunks();
        std::array::from_fn(|k| f64::from_le_bytes(chunks[k]))
    }

    fn joints(&self) -> Joints {
        Joints::from(self.numbers::<6>())
    }

    fn live(&mut self) -> &mut Live {
        self.live.as_mut().expect("a scene was loaded")
    }

    fn answer(&mut self, results: Vec<f64>) -> usize {
        self.results = results;
        self.results.len()
    }
}

fn with<T>(run: impl FnOnce(&mut State) -> T) -> T {
    STATE.with_borrow_mut(run)
}

/// Distance, both witnesses, and the two closest solids.
fn numbers_of(pair: &PairClearance) -> [f64; 9] {
    let separation = &pair.separation;
    let (a, b) = (separation.point_on_a, separation.point_on_b);
    let distance_m = separation.distance_m;
    let [first, second] = [pair.solid_a, pair.solid_b].map(|solid| solid as f64);
    [distance_m, a.x, a.y, a.z, b.x, b.y, b.z, first, second]
}

/// Memory for so many bytes of input.
#[unsafe(no_mangle)]
extern "C" fn input(bytes: usize) -> *mut u8 {
    with(|state| {
        state.input.clear();
        state.input.resize(bytes, 0);
        state.input.as_mut_ptr()
    })
}

/// Where the numbers of the last answer are.
#[unsafe(no_mangle)]
extern "C" fn results() -> *const f64 {
    with(|state| state.results.as_ptr())
}

/// Where the last message is.
#[unsafe(no_mangle)]
extern "C" fn message() -> *const u8 {
    with(|state| state.message.as_ptr())
}

/// Prepares the scene of the input; 1 if it is valid.
#[unsafe(no_mangle)]
extern "C" fn load() -> u32 {
    with(|state| {
        state.live = Scene::decode(&state.input).map(Live::new);
        u32::from(state.live.is_some())
    })
}

/// Moves the base to a position (mm) and roll, pitch and yaw (deg): six numbers. Returns the length of the
/// message on why its mount cannot carry it there, and 0 if it can.
#[unsafe(no_mangle)]
extern "C" fn place_base() -> usize {
    with(|state| {
        let [x, y, z, roll, pitch, yaw] = state.numbers();
        let pose = pose_of([x, y, z], [roll, pitch, yaw]);
        state.message = match state.live().place_base(&pose) {
            Ok(()) => String::new(),
            Err(error) => error.to_string(),
        };
        state.message.len()
    })
}

/// Moves the base back to its placement in the scene.
#[unsafe(no_mangle)]
extern "C" fn reset_base() {
    with(|state| state.live().reset_base());
}

/// Clearances at six joint positions (rad): nine numbers for each pair of the scene.
#[unsafe(no_mangle)]
extern "C" fn pairs() -> usize {
    with(|state| {
        let q = state.joints();
        let pairs = state.live().pairs(&q);
        state.answer(pairs.iter().flat_map(numbers_of).collect())
    })
}

/// Lowest point over the floor at six joint positions (rad), m.
#[unsafe(no_mangle)]
extern "C" fn lowest() -> f64 {
    with(|state| {
        let q = state.joints();
        state.live().lowest_m(&q)
    })
}

/// All eight configurations at a goal: outcome, roll, constraint margin, six joint positions (NaN without a
/// posture), and pair and distance of the pair closest to its limit (NaN without).
#[unsafe(no_mangle)]
extern "C" fn reach(goal: usize, rolls: u32) -> usize {
    with(|state| {
        let found = state.live().reach(goal, rolls);
        let rows = found.iter().flat_map(|reach| {
            let nearest = reach.nearest.as_ref();
            let joints = reach.joints.unwrap_or_else(|| Joints::repeat(f64::NAN));
            let pair = nearest.map_or(f64::NAN, |pair| pair.pair as f64);
            let distance_m = nearest.map_or(f64::NAN, |pair| pair.separation.distance_m);
            [
                f64::from(reach.outcome as u8),
                reach.roll_rad,
                reach.surplus_m,
            ]
            .into_iter()
            .chain(Vec::from(joints.as_slice()))
            .chain([pair, distance_m])
        });
        let results = rows.collect();
        state.answer(results)
    })
}

/// Overlaps of base and mount: body, other body and depth (m) of each.
#[unsafe(no_mangle)]
extern "C" fn overlaps() -> usize {
    with(|state| {
        let found = state.live().overlaps();
        let rows = found
            .iter()
            .flat_map(|it| [it.body as f64, it.other as f64, it.depth_m]);
        state.answer(rows.collect())
    })
}

/// The mount where it is now: corners of triangles.
#[unsafe(no_mangle)]
extern "C" fn mount_surface() -> usize {
    with(|state| {
        let surfaces = state.live().mount_surfaces();
        let corners = surfaces.iter().flat_map(|mesh| {
            let indices = mesh.triangles.iter().flatten();
            indices.flat_map(|index| {
                let corner = mesh.vertices_m[*index as usize];
                [corner.x, corner.y, corner.z]
            })
        });
        let results = corners.collect();
        state.answer(results)
    })
}
