//! The folder of a patient that was built from a scan, read and checked.

use std::path::Path;
use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;

use nalgebra::Point3;
use needlebench_bench::Desk;
use needlebench_input::Finding;
use needlebench_patient::Stop;
use needlebench_patient::ct::{BuiltFolder, SCENARIO_FILE};
use needlebench_scenario::scenario::GoalSection;
use needlebench_scenario::{OpenScenario, Overrides, load_open_scenario};
use needlebench_volume::{LabelMap, VoxelGrid};

use crate::around::LastTarget;

/// A voxel, and what is there.
#[derive(Debug, Clone, PartialEq)]
pub struct Place {
    /// Centre in `ct`, m.
    pub ct_m: Point3<f64>,
    /// Hounsfield units; none outside the volume.
    pub hu: Option<i16>,
    /// What its label is called; none outside of everything.
    pub label: Option<String>,
}

/// A patient that was built from a scan, with the room.
pub struct Case {
    built: BuiltFolder,
    overrides: Overrides,
    hu: Vec<i16>,
    goals: Vec<GoalSection>,
    desk: Desk,
    run_desk: OnceLock<Desk>,
    last_target: LastTarget,
}

impl Case {
    /// Reads a folder that `needlebench ct build` made.
    ///
    /// # Errors
    /// What is missing, what is wrong with it, and what does not belong together; interrupted.
    pub fn open(folder: &Path, overrides: &Overrides, cancel: &AtomicBool) -> Result<Self, Stop> {
        let built = BuiltFolder::read(folder, cancel)?;
        let volume = built.volume(cancel)?;
        let OpenScenario { resolved, goals } =
            load_open_scenario(&folder.join(SCENARIO_FILE), overrides)?;
        let file = resolved.source.file.clone();
        built.check_scenario(&file, &resolved.scenario)?;
        Ok(Self {
            built,
            overrides: overrides.clone(),
            hu: volume.hu,
            goals,
            desk: Desk::new(resolved).map_err(|error| Finding::new(file, error.to_string()))?,
            run_desk: OnceLock::new(),
            last_target: LastTarget::default(),
        })
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        self.built.folder()
    }

    /// What was built.
    pub fn built(&self) -> &BuiltFolder {
        &self.built
    }

    /// What the command line puts in place of the scenario's.
    pub fn overrides(&self) -> &Overrides {
        &self.overrides
    }

    /// Hounsfield units: columns run fastest, slices slowest.
    pub fn hu(&self) -> &[i16] {
        &self.hu
    }

    /// What each voxel is.
    pub fn labels(&self) -> &LabelMap {
        self.built.labels()
    }

    /// Where the voxels are, to the last digit: the report's, not those of a file of single precision.
    pub fn grid(&self) -> &VoxelGrid {
        &self.labels().grid
    }

    /// Goals of the scenario, with or without an entry.
    pub fn goals(&self) -> &[GoalSection] {
        &self.goals
    }

    /// The room, for goals to be tried in.
    pub fn desk(&self) -> &Desk {
        &self.desk
    }

    /// The voxels around the target that was asked about last.
    pub(crate) fn last_target(&self) -> &LastTarget {
        &self.last_target
    }

    /// The room as a run of a plan has it, made once.
    ///
    /// # Errors
    /// What `make` says; it is asked again the next time.
    pub(crate) fn run_desk<E>(&self, make: impl FnOnce() -> Result<Desk, E>) -> Result<&Desk, E> {
        if let Some(known) = self.run_desk.get() {
            return Ok(known);
        }
        let made = make()?;
        Ok(self.run_desk.get_or_init(|| made))
    }

    /// From `ct` to the scenario's phantom frame, m.
    pub fn in_phantom(&self, ct_m: &Point3<f64>) -> Point3<f64> {
        ct_m - self.built.origin_in_ct_m()
    }

    /// From the scenario's phantom frame to `ct`, m.
    pub fn in_ct(&self, phantom_m: &Point3<f64>) -> Point3<f64> {
        phantom_m + self.built.origin_in_ct_m()
    }

    /// What is at an index, which may lie between voxels: the place to the last digit, the value of the nearest voxel.
    pub fn place(&self, index: &Point3<f64>) -> Place {
        let offset = self.nearest_voxel(index);
        Place {
            ct_m: self.grid().ct_from_index(index),
            hu: offset.map(|offset| self.hu[offset]),
            label: offset.and_then(|offset| self.label_name(self.labels().labels[offset])),
        }
    }

    /// Offset of the voxel that an index is in; none outside the volume.
    pub(crate) fn nearest_voxel(&self, index: &Point3<f64>) -> Option<usize> {
        let voxel = self.grid().voxel_at(index)?;
        Some(self.grid().offset(voxel))
    }

    /// What a label is called; none of what is outside of everything.
    pub(crate) fn label_name(&self, label: u16) -> Option<String> {
        if label == 0 {
            return None;
        }
        let known = self.labels().names.iter().find(|(each, _)| *each == label);
        Some(known.map_or_else(|| format!("label {label}"), |(_, name)| name.clone()))
    }
}
