//! Which axes run through space.

use crate::VolumeError;
use crate::read::DAMAGED;
use crate::read::text_header::{Entries, Entry, number};

/// Most axes that NRRD has.
const MOST: usize = 16;

/// The axes of the numbers, fastest first.
#[derive(Debug)]
pub(super) struct Axes {
    /// Lengths of the three in space.
    pub(super) size: [usize; 3],
    /// Steps along these in the units of the space, where the header has them.
    pub(super) steps: Option<[[f64; 3]; 3]>,
    /// Distances between voxels along these, where the header has them without directions.
    pub(super) spacings: Option<[f64; 3]>,
    /// Numbers at each voxel, which are beside each other.
    pub(super) layers: usize,
    /// What several of these are where they are no segments' layers.
    pub(super) no_volume: Option<VolumeError>,
}

/// An axis beside those in space, by what its `kinds` say.
fn other_axis(kind: Option<&str>, length: usize) -> (String, &'static str) {
    match kind.unwrap_or_default() {
        "time" => (format!("{length} volumes of a series in time"), SEQUENCE),
        "complex" => ("complex numbers".to_owned(), NUMBERS),
        kind if kind.contains("color") => ("colours, not numbers".to_owned(), NUMBERS),
        kind if kind.contains("vector") || kind.contains("matrix") || kind.contains("normal") => (
            format!("vectors or matrices, {length} numbers a voxel"),
            NUMBERS,
        ),
        _ => (
            format!("{length} volumes (a sequence or MultiVolume)"),
            SEQUENCE,
        ),
    }
}

const SEQUENCE: &str =
    "write the required one to its own file: in 3D Slicer, save the volume node of one item";
const NUMBERS: &str = "write one number per voxel: in 3D Slicer, `Vector to Scalar Volume`";

pub(super) fn axes(fields: &Entries) -> Result<Axes, VolumeError> {
    let dimension = fields.wanted("dimension")?;
    let count: usize = dimension.whole()?;
    if !(1..=MOST).contains(&count) {
        return Err(dimension
            .refused(format!("it has {count} axes, 1 to {MOST} allowed"))
            .hint(DAMAGED));
    }
    let sizes = fields.wanted("sizes")?;
    let lengths = sizes.lengths(Some(count))?;
    let directions = match fields.get("space directions") {
        Some(entry) => Some(vectors(entry, count)?),
        None => None,
    };
    let kinds = match fields.get("kinds") {
        Some(entry) => Some(words(entry, count)?),
        None => None,
    };
    let in_space = in_space(&lengths, directions.as_deref(), kinds.as_deref());
    let Ok(space) = <[usize; 3]>::try_from(in_space) else {
        return Err(sizes
            .refused(format!(
                "it has {count} axes, of which not three run through space: not a volume"
            ))
            .hint("write a volume with three axes, e.g. with 3D Slicer"));
    };
    let mut layers = 1;
    let mut no_volume = None;
    for (axis, length) in lengths.iter().copied().enumerate() {
        if space.contains(&axis) || length == 1 {
            continue;
        }
        let kind = kinds.as_ref().map(|kinds| kinds[axis].to_ascii_lowercase());
        let kind = kind.as_deref();
        let (what, hint) = other_axis(kind, length);
        let refused = sizes
            .refused(format!("it has {what}; a CT has one number a voxel"))
            .hint(hint);
        // Layers of a segmentation are beside each other. Whether there are some, its segments say.
        let may_be_layers = matches!(kind, Some("list" | "???" | "none" | "vector") | None);
        if axis < space[0] && layers == 1 && may_be_layers {
            layers = length;
            no_volume = Some(refused);
        } else {
            return Err(refused);
        }
    }
    let spacings = match fields.get("spacings") {
        Some(entry) => {
            let words = words(entry, count)?;
            let each = |axis: usize| number(&words[axis], entry).map(f64::abs);
            Some([each(space[0])?, each(space[1])?, each(space[2])?])
        }
        None => None,
    };
    let steps = directions.and_then(|directions| {
        let [i, j, k] = space.map(|axis| directions[axis]);
        Some([i?, j?, k?])
    });
    Ok(Axes {
        size: space.map(|axis| lengths[axis]),
        steps,
        spacings,
        layers,
        no_volume,
    })
}

/// The axes in space: those with a direction, else those whose kind says so, else those that are longer than 1.
fn in_space(
    lengths: &[usize],
    directions: Option<&[Option<[f64; 3]>]>,
    kinds: Option<&[String]>,
) -> Vec<usize> {
    let all = 0..lengths.len();
    if let Some(directions) = directions {
        return all.filter(|axis| directions[*axis].is_some()).collect();
    }
    if lengths.len() == 3 {
        return all.collect();
    }
    let is_space = |axis: &usize| {
        kinds.is_some_and(|kinds| {
            matches!(
                kinds[*axis].to_ascii_lowercase().as_str(),
                "domain" | "space"
            )
        })
    };
    let of_kinds: Vec<usize> = all.clone().filter(is_space).collect();
    if of_kinds.is_empty() {
        all.filter(|axis| lengths[*axis] > 1).collect()
    } else {
        of_kinds
    }
}

/// One word an axis.
fn words(entry: &Entry, count: usize) -> Result<Vec<String>, VolumeError> {
    let words: Vec<String> = entry.value.split_whitespace().map(str::to_owned).collect();
    if words.len() == count {
        Ok(words)
    } else {
        Err(entry
            .refused(format!(
                "it has {} words, but there are {count} axes",
                words.len()
            ))
            .hint(DAMAGED))
    }
}

/// One vector of three an axis; `none` for an axis outside space.
fn vectors(entry: &Entry, count: usize) -> Result<Vec<Option<[f64; 3]>>, VolumeError> {
    let mut vectors = Vec::new();
    let mut rest = entry.value.trim();
    while !rest.is_empty() {
        let (one, after) = if rest.starts_with('(') {
            let Some(end) = rest.find(')') else {
                return Err(entry.refused("a bracket is not closed").hint(DAMAGED));
            };
            (Some(vector(&rest[..=end], entry)?), &rest[end + 1..])
        } else {
            let end = rest.find(|letter: char| letter.is_whitespace() || letter == '(');
            let (word, after) = rest.split_at(end.unwrap_or(rest.len()));
            if !matches!(word.to_ascii_lowercase().as_str(), "none" | "???") {
                return Err(entry
                    .refused("a direction is written (x,y,z), or none for an axis outside space")
                    .hint(DAMAGED));
            }
            (None, after)
        };
        vectors.push(one);
        rest = after.trim_start();
    }
    if vectors.len() == count {
        Ok(vectors)
    } else {
        Err(entry
            .refused(format!(
                "it has {} directions, but there are {count} axes",
                vectors.len()
            ))
            .hint(DAMAGED))
    }
}

/// `(x,y,z)`.
pub(super) fn vector(text: &str, entry: &Entry) -> Result<[f64; 3], VolumeError> {
    let inner = text
        .trim()
        .strip_prefix('(')
        .and_then(|text| text.strip_suffix(')'));
    let numbers: Vec<f64> = inner
        .unwrap_or_default()
        .split(',')
        .map(|word| number(word.trim(), entry))
        .collect::<Result<_, _>>()?;
    <[f64; 3]>::try_from(numbers).map_err(|numbers| {
        entry
            .refused(format!(
                "a vector has {} numbers, in a space of three dimensions",
                numbers.len()
            ))
            .hint(DAMAGED)
    })
}
