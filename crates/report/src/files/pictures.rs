//! Pictures and charts of a run's goals.

use needlebench_evaluation::report::{ConfigurationReport, GoalReport, Report};
use needlebench_evaluation::room::RoomModel;
use needlebench_parallel::in_parallel;
use needlebench_render::{Image, tile};
use needlebench_scenario::ResolvedScenario;

use super::error::FilesError;
use super::folder::Folder;
use crate::chart::budget::budget_chart;
use crate::chart::ranking::ranking_chart;
use crate::picture::configuration::{Backdrop, Shown, configuration_picture, sheet_caption};
use crate::picture::room::{RoomPictures, room_caption};

/// What is added to the names of pictures: those of the posture, those of the free space.
const KINDS: [&str; 2] = ["", ".room"];
/// What is added to the names of charts.
const CHARTS: [&str; 2] = [".ranking", ".budget"];
/// Pictures in a row of a sheet.
const SHEET_COLUMNS: usize = 4;

/// Removes what an earlier run drew of a goal, beside the goal's own folder.
pub(super) fn remove_pictures(folder: Folder<'_>, goal: &str) -> Result<(), FilesError> {
    for kind in KINDS {
        folder.remove(&format!("{goal}{kind}.png"))?;
    }
    CHARTS
        .iter()
        .try_for_each(|kind| folder.remove_chart(&format!("{goal}{kind}")))
}

/// What all pictures of a run have in common.
pub(super) struct Pictures<'a> {
    resolved: &'a ResolvedScenario,
    folder: Folder<'a>,
    jobs: usize,
    backdrop: Backdrop,
    room: RoomModel<'a>,
}

impl<'a> Pictures<'a> {
    pub(super) fn new(resolved: &'a ResolvedScenario, folder: Folder<'a>, jobs: usize) -> Self {
        Self {
            resolved,
            folder,
            jobs,
            backdrop: Backdrop::new(resolved),
            room: RoomModel::new(resolved),
        }
    }

    /// Writes the pictures of a goal's configurations, adding to the names of their files, sheets of
    /// them, and the goal's charts.
    pub(super) fn write(
        &self,
        index: usize,
        run: &Report,
        names: &mut [Vec<String>],
    ) -> Result<(), FilesError> {
        let goal = &self.resolved.goals[index].name;
        let report = &run.goals[index];
        let [posture, space] = KINDS;
        {
            let stage = self
                .backdrop
                .stage(self.resolved, &self.resolved.goals[index]);
            let draw = |shown: &Shown<'_>| configuration_picture(self.resolved, &stage, shown);
            self.write_kind(posture, index, run, names, &draw, sheet_caption)?;
        }
        let room = RoomPictures::new(self.resolved, &self.backdrop, &self.room, index);
        self.write_kind(
            space,
            index,
            run,
            names,
            &|shown: &Shown<'_>| room.draw(shown),
            room_caption,
        )?;
        for (kind, chart) in CHARTS
            .iter()
            .zip([ranking_chart(report), budget_chart(report)])
        {
            let stem = format!("{goal}{kind}");
            match chart {
                Some(chart) => {
                    self.folder.write_chart(&stem, &chart)?;
                }
                None => self.folder.remove_chart(&stem)?,
            }
        }
        Ok(())
    }

    /// Draws all configurations of a goal, on all threads, and a sheet of them.
    fn write_kind(
        &self,
        kind: &str,
        index: usize,
        run: &Report,
        names: &mut [Vec<String>],
        draw: &(impl Fn(&Shown<'_>) -> Option<Image> + Sync),
        caption: fn(&GoalReport, &ConfigurationReport) -> String,
    ) -> Result<(), FilesError> {
        let goal = &self.resolved.goals[index];
        let report = &run.goals[index];
        let drawn = in_parallel(self.jobs, &report.configurations, |configuration| {
            let image = draw(&Shown {
                run,
                goal,
                configuration,
            })?;
            Some(image.to_png().map(|png| (image, png)))
        });
        let mut sheet = Vec::new();
        for ((configuration, names), drawn) in report.configurations.iter().zip(names).zip(drawn) {
            let Some(drawn) = drawn else { continue };
            let (image, png) = drawn?;
            let name = format!("{}/{}{kind}.png", goal.name, configuration.label);
            self.folder.write(&name, png)?;
            names.push(name);
            sheet.push((image, caption(report, configuration)));
        }
        let name = format!("{}{kind}.png", goal.name);
        if sheet.is_empty() {
            self.folder.remove(&name)
        } else {
            self.folder.write_image(&name, &tile(&sheet, SHEET_COLUMNS))
        }
    }
}
