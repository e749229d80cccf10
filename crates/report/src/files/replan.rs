//! Static cases of a study that were planned too: what is planned once is kept in the study's folder.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;

use needlebench_bench::study::{PreparedStudy, ReplanControl, Replanned, replan_draw, replanned};
use needlebench_input::sha256_hex;
use needlebench_parallel::Progress;
use needlebench_scenario::study::StudyMode;
use needlebench_study::ParquetResults;
use needlebench_study::statistics::Summary;

use super::error::FilesError;
use super::folder::Folder;

/// Name of the file in a study's folder.
const FILE: &str = "replanned.txt";

/// Plans the cases that the study asks for; none of a study without static cases, or that asks for none.
pub(super) fn replan(
    prepared: &PreparedStudy,
    results: &ParquetResults,
    summary: &Summary,
    folder: Folder<'_>,
    threads: usize,
    cancel: Option<&AtomicBool>,
    progress: &dyn Progress,
) -> Result<Option<Replanned>, FilesError> {
    let draw = replan_draw(prepared, results, summary.choices.as_ref())?;
    if !prepared.modes().contains(&StudyMode::Static) || draw.cases.is_empty() {
        folder.remove(FILE)?;
        return Ok(None);
    }
    let id = &prepared.identity.id;
    let known = read(folder, id);
    let kept = Mutex::new((known.clone(), None));
    let done = |case: u64, bits: u8| {
        let (kept, failed) = &mut *kept.lock().expect("no thread panics");
        kept.insert(case, bits);
        if let Err(error) = folder.write(FILE, text(id, kept)) {
            failed.get_or_insert(error);
        }
    };
    let control = ReplanControl {
        threads,
        cancel,
        progress,
    };
    let planned = replanned(prepared, &draw, &known, control, &done).map_err(FilesError::Replan)?;
    if let (_, Some(error)) = kept.into_inner().expect("no thread panics") {
        return Err(error);
    }
    let drawn = planned.ok_or(FilesError::Interrupted)?;
    // Of this draw alone: the same bytes whatever was there before.
    let bits: BTreeMap<u64, u8> = drawn.iter().map(|each| (each.case, each.planned)).collect();
    folder.write(FILE, text(id, &bits))?;
    Ok(Some(Replanned::new(&draw, drawn)))
}

/// What is kept: a hash of the rest, the study, and a line for each case.
fn text(id: &str, planned: &BTreeMap<u64, u8>) -> String {
    let lines: Vec<String> = planned
        .iter()
        .map(|(case, bits)| format!("{case} {bits}\n"))
        .collect();
    let body = format!("study {id}\n{}", lines.concat());
    format!("{}\n{body}", sha256_hex(body.as_bytes()))
}

/// What was planned before; nothing of another study, and nothing of a file that is damaged.
fn read(folder: Folder<'_>, id: &str) -> BTreeMap<u64, u8> {
    let read = std::fs::read_to_string(folder.path(FILE)).unwrap_or_default();
    let mut lines = read.lines();
    let of_study = lines.by_ref().nth(1) == Some(format!("study {id}").as_str());
    let pair = |line: &str| {
        let (case, bits) = line.split_once(' ')?;
        Some((case.parse().ok()?, bits.parse().ok()?))
    };
    let known: BTreeMap<u64, u8> = lines.filter_map(pair).collect();
    if of_study && text(id, &known) == read {
        known
    } else {
        BTreeMap::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_comes_back_unless_it_is_damaged_or_of_another_study() {
        let folder = tempfile::tempdir().unwrap();
        let folder = Folder(folder.path());
        assert!(read(folder, "a").is_empty());
        let planned = BTreeMap::from([(3, 1), (70, 255)]);
        let kept = text("a", &planned);
        folder.write(FILE, &kept).unwrap();
        assert_eq!(read(folder, "a"), planned);
        assert!(read(folder, "b").is_empty());
        for damaged in [
            kept.replace("70 255", "70 254"),
            kept[..kept.len() - 3].to_owned(),
        ] {
            folder.write(FILE, damaged).unwrap();
            assert!(read(folder, "a").is_empty());
        }
    }
}
