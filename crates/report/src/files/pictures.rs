//! Pictures and charts of a run's goals.

use needlebench_evaluation::report::Report;
use needlebench_evaluation::room::RoomModel;
use needlebench_parallel::in_parallel;
use needlebench_render::{Image, tile};
use needlebench_scenario::ResolvedScenario;

use super::error::FilesError;
use super::folder::Folder;
use crate::chart::budget::budget_chart;
use crate::chart::ranking::ranking_chart;
use crate::picture::configuration::{
    Backdrop, Shown, configuration_picture, goal_camera, sheet_caption,
};
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
        let mut sheets = [Vec::new(), Vec::new()];
        for (at, pictures) in self.draw(index, run).into_iter().enumerate() {
            let configuration = &report.configurations[at];
            let captions = [
                sheet_caption(report, configuration),
                room_caption(report, configuration),
            ];
            let kinds = KINDS.iter().zip(&mut sheets).zip(captions);
            for (picture, ((kind, sheet), caption)) in pictures.into_iter().zip(kinds) {
                let Some(image) = picture else { continue };
                let name = format!("{goal}/{}{kind}.png", configuration.label);
                self.folder.write_image(&name, &image)?;
                names[at].push(name);
                sheet.push((image, caption));
            }
        }
        for (kind, sheet) in KINDS.iter().zip(&sheets) {
            let name = format!("{goal}{kind}.png");
            if sheet.is_empty() {
                self.folder.remove(&name)?;
            } else {
                self.folder
                    .write_image(&name, &tile(sheet, SHEET_COLUMNS))?;
            }
        }
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

    /// Pictures of all configurations of a goal, on all threads.
    fn draw(&self, index: usize, run: &Report) -> Vec<[Option<Image>; 2]> {
        let goal = &self.resolved.goals[index];
        let camera = goal_camera(self.resolved, goal);
        let room = RoomPictures::new(self.resolved, &self.backdrop, &self.room, index);
        let all = run.goals[index].configurations.iter();
        let all: Vec<_> = all.flat_map(|each| [(each, false), (each, true)]).collect();
        let drawn = in_parallel(self.jobs, &all, |(configuration, is_room)| {
            let shown = Shown {
                run,
                goal,
                configuration,
            };
            if *is_room {
                room.draw(&shown)
            } else {
                configuration_picture(self.resolved, &self.backdrop, &camera, &shown)
            }
        });
        let mut drawn = drawn.into_iter();
        let mut next = || drawn.next().flatten();
        run.goals[index]
            .configurations
            .iter()
            .map(|_| [next(), next()])
            .collect()
    }
}
