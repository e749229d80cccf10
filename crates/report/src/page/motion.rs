//! Recorded motions and clearances along them.

use needlebench_bench::EngineRun;
use needlebench_engine::Recording;
use needlebench_evaluation::ClearanceSeries;
use serde_json::{Value, json};

use super::pack::Pack;

/// Time between two postures of a replay, s. Between them joints turn by far less than shows: at the
/// UR3's 20 rad/s^2 a chord leaves the course by 4 mrad at most, at planned speeds by a tenth of it.
const POSTURE_PERIOD_S: f64 = 0.04;
/// Points of a clearance curve: as many as a plot has pixels.
const MOST_POINTS: usize = 700;

/// The document's part on one engine's motion. Closest pairs are stored for the `first` one alone: where it
/// came to its end, engines agree to far less than shows.
pub(super) fn motion(run: &EngineRun, first: bool, stopped: bool, pack: &mut Pack) -> Value {
    let (time_s, joints) = postures(&run.recording, pack);
    let (curve_time_s, curves) = curves(&run.clearance, pack);
    let nearest = (first || stopped).then(|| nearest(&run.clearance, pack));
    json!({
        "engine": run.engine,
        "stopped": stopped,
        "time": time_s,
        "joints": joints,
        "curveTime": curve_time_s,
        "curves": curves,
        "nearest": nearest,
    })
}

/// The closest pair over time: pairs by their names, and per sample its time, its pair (255 for none) and
/// the two nearest points in the world.
fn nearest(series: &ClearanceSeries, pack: &mut Pack) -> Value {
    let period_s = |window: &[f64]| window[1] - window[0];
    let sample_s = series.time_s.windows(2).map(period_s).next();
    let stride = sample_s.map_or(1.0, |sample_s| POSTURE_PERIOD_S / sample_s);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a few dozen samples"
    )]
    let stride = stride.round().max(1.0) as usize;
    let last = series.nearest.len().saturating_sub(1);
    let kept: Vec<usize> = (0..series.nearest.len())
        .filter(|index| index % stride == 0 || *index == last)
        .collect();
    let pairs: Vec<u8> = kept
        .iter()
        .map(|&index| {
            let pair = series.nearest[index].map(|found| found.pair);
            pair.and_then(|pair| u8::try_from(pair).ok())
                .unwrap_or(u8::MAX)
        })
        .collect();
    let classes: Vec<&str> = (0..series.nearest_pairs.len())
        .filter_map(|pair| {
            let mut all = series.nearest.iter().flatten();
            all.find(|found| found.pair == pair)
                .map(|found| found.class.name())
        })
        .collect();
    let columns: Vec<Value> = (0..6)
        .map(|axis| {
            let column: Vec<f64> = kept
                .iter()
                .map(|&index| {
                    let found = series.nearest[index];
                    found.map_or(f64::NAN, |found| found.witness_points_m[axis / 3][axis % 3])
                })
                .collect();
            pack.column(&column, true)
        })
        .collect();
    json!({
        "names": series.nearest_pairs,
        "classes": classes,
        "time": pack.f32s(kept.iter().map(|&index| series.time_s[index])),
        "pair": pack.u8s(&pairs),
        "points": columns,
    })
}

/// Times and a column per joint.
fn postures(recording: &Recording, pack: &mut Pack) -> (Value, Value) {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a few dozen steps"
    )]
    let stride = (POSTURE_PERIOD_S / recording.timestep_s).round().max(1.0) as usize;
    let last = recording.state.len().saturating_sub(1);
    let mut indices: Vec<usize> = (0..recording.state.len()).step_by(stride).collect();
    if indices.last().is_some_and(|index| *index != last) {
        indices.push(last);
    }
    let times: Vec<f64> = indices
        .iter()
        .map(|&index| recording.time_s[index])
        .collect();
    let columns: Vec<Value> = (0..6)
        .map(|joint| {
            let values: Vec<f64> = indices
                .iter()
                .map(|&index| recording.state[index].position[joint])
                .collect();
            pack.column(&values, true)
        })
        .collect();
    (pack.f32s(times), json!(columns))
}

/// Times and a column per class, m. Where there are more samples than points, a point is the least of
/// its samples: no minimum is lost.
fn curves(series: &ClearanceSeries, pack: &mut Pack) -> (Value, Value) {
    let each = series.time_s.len().div_ceil(MOST_POINTS).max(1);
    let times: Vec<f64> = series.time_s.chunks(each).map(|chunk| chunk[0]).collect();
    let mut curves = serde_json::Map::new();
    for (class, distances_m) in &series.distance_m {
        let least: Vec<f64> = distances_m
            .chunks(each)
            .map(|chunk| chunk.iter().copied().fold(f64::INFINITY, f64::min))
            .collect();
        curves.insert(class.name().to_owned(), pack.column(&least, true));
    }
    (pack.f32s(times), Value::Object(curves))
}
