//! Whether numbers can be Hounsfield units.

use super::Tally;
use super::scalar::UNSEEN_BELOW_HU;
use crate::{AIR_HU, HuHistogram, Remark, Volume};

/// What the extended scale of scanners reaches.
const BELIEVABLE_HU: [f64; 2] = [-4100.0, 32767.0];

/// Greatest values of scanners with 12 bits, by their offset (-1024, -1000): denser things look like this.
const PLATEAUS_HU: [i16; 2] = [3071, 3095];

/// Voxels at the greatest value that are no accident.
const A_PLATEAU: usize = 8;

/// What is odd about a volume's values.
pub(super) fn remarks(volume: &Volume, tally: &Tally) -> Vec<Remark> {
    let mut remarks = Vec::new();
    let of = volume.hu.len();
    let mut say = |count: u64, what: &str| {
        if count > 0 {
            remarks.push(Remark::new(format!("{count} of {of} voxels {what}")));
        }
    };
    say(
        tally.padding,
        &format!(
            "are padding or below {UNSEEN_BELOW_HU} HU, outside the field of view: set to air \
             ({AIR_HU} HU)"
        ),
    );
    say(tally.not_numbers, "are not numbers: set to air");
    say(tally.rounded, "are not whole HU: rounded");
    say(
        tally.clipped,
        &format!("are above {} HU: clipped", i16::MAX),
    );
    let [least, greatest] = tally.range_hu;
    if greatest < least {
        remarks.push(Remark::new("no voxel was measured: all are padding"));
        return remarks;
    }
    if least < BELIEVABLE_HU[0] || greatest > BELIEVABLE_HU[1] {
        remarks.push(Remark::new(format!(
            "values range from {least:.0} to {greatest:.0} HU, implausible for a CT: check slope \
             and intercept"
        )));
    }
    #[expect(
        clippy::cast_possible_truncation,
        reason = "saturates, and is no plateau then"
    )]
    let top = greatest as i16;
    if PLATEAUS_HU.contains(&top) {
        let count = volume.hu.iter().filter(|hu| **hu == top).count();
        if count >= A_PLATEAU {
            remarks.push(Remark::new(format!(
                "{count} voxels have the maximum 12-bit value, {top} HU: denser material, such as \
                 metal, was clipped by the scanner"
            )));
        }
    }
    remarks.extend(air(volume));
    remarks
}

fn air(volume: &Volume) -> Option<Remark> {
    let histogram = HuHistogram::sampled(&volume.hu);
    if histogram.has_air_peak() {
        return None;
    }
    Some(Remark::new(match histogram.air_peak_hu() {
        Some(peak) => format!(
            "the air peak is at {peak} HU, more than 60 from -1000: are these Hounsfield units?"
        ),
        None => {
            "there is no air (nothing near -1000 HU): is it a CT in Hounsfield units?".to_owned()
        }
    }))
}
