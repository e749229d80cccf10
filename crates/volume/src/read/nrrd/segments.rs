//! Segments of 3D Slicer: keys `Segment0_Name`, `Segment0_LabelValue`, `Segment0_Layer` and `Segment0_Tags`.

use std::collections::BTreeMap;

use super::axes::Axes;
use crate::read::DAMAGED;
use crate::read::segments::{Segment, Segments, name_of};
use crate::read::text_header::Entry;
use crate::{Remark, VolumeError};

/// What the keys say of one segment.
#[derive(Debug, Default)]
struct Said {
    name: Option<String>,
    value: Option<u16>,
    layer: Option<usize>,
    coded_type: Option<String>,
    side: Option<String>,
}

/// The segments of a file, and how many numbers it has at each voxel.
pub(super) fn segments(
    keys: &[Entry],
    axes: &Axes,
    remarks: &mut Vec<Remark>,
) -> Result<Segments, VolumeError> {
    let mut said: BTreeMap<u32, Said> = BTreeMap::new();
    for entry in keys {
        let is_fractional =
            entry.key.starts_with("Segmentation_") && entry.value.starts_with("Fractional");
        if is_fractional {
            return Err(entry
                .refused("the segmentation has fractions of segments, which are not read")
                .hint("in 3D Slicer, export it as a binary label map"));
        }
        let Some((number, what)) = entry
            .key
            .strip_prefix("Segment")
            .and_then(|key| key.split_once('_'))
        else {
            continue;
        };
        let Ok(number) = number.parse::<u32>() else {
            continue;
        };
        let one = said.entry(number).or_default();
        match what {
            "Name" => {
                one.name = Some(entry.value.trim().to_owned()).filter(|name| !name.is_empty());
            }
            "LabelValue" => {
                let value: u16 = entry.whole()?;
                if value == 0 {
                    return Err(entry
                        .refused("the label of a segment is 0, which is that of nothing")
                        .hint(DAMAGED));
                }
                one.value = Some(value);
            }
            "Layer" => one.layer = Some(entry.whole()?),
            "Tags" => (one.coded_type, one.side) = terminology(&entry.value),
            _ => {}
        }
    }
    if let (true, Some(refused)) = (said.is_empty(), &axes.no_volume) {
        return Err(refused.clone());
    }
    let has_layers = axes.layers > 1;
    let segments = (1_usize..).zip(said.into_values()).map(|(number, one)| {
        Segment::new(
            name_of(one.name.as_ref(), one.coded_type, one.side, number),
            // Files of older programs have neither: each segment has a layer of its own.
            one.layer.unwrap_or(if has_layers { number - 1 } else { 0 }),
            one.value.unwrap_or(1),
        )
    });
    Segments::new(axes.layers, segments.collect(), remarks)
}

/// Type and side of an entry of a terminology: `TerminologyEntry:context~category~type~modifier~...|`, each of them
/// `scheme^code^meaning`.
fn terminology(tags: &str) -> (Option<String>, Option<String>) {
    let entry = tags.split('|').find_map(|tag| {
        let (key, value) = tag.split_once(':')?;
        matches!(key.trim(), "TerminologyEntry" | "Terminology").then_some(value)
    });
    let mut parts = entry.unwrap_or_default().split('~').skip(2);
    let mut meaning = || {
        let meaning = parts.next()?.split('^').nth(2)?.trim();
        (!meaning.is_empty()).then(|| meaning.to_owned())
    };
    (meaning(), meaning())
}
