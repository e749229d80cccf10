//! How a patient lies in the room: as in the scanner, unless something says otherwise.

use needlebench_imaging::registration::ReferenceFrame;
use needlebench_patient::ct::{PatientFrame, ScanBuild};
use needlebench_scenario::ResolvedScenario;
use needlebench_scenario::scenario::{GantrySection, PhantomSection, Posture, Scenario};
use needlebench_volume::{Lying, PatientPosition, Remark};

fn posture(lying: Lying) -> Posture {
    match lying {
        Lying::Supine => Posture::Supine,
        Lying::Prone => Posture::Prone,
        Lying::LeftSide => Posture::LeftLateral,
        Lying::RightSide => Posture::RightLateral,
    }
}

fn word(posture: Posture) -> &'static str {
    match posture {
        Posture::Supine => "supine",
        Posture::Prone => "prone",
        Posture::LeftLateral => "left-lateral",
        Posture::RightLateral => "right-lateral",
    }
}

/// Lays the patient in the room: as `given`, else as the scan says, else as the room has it. Markers that register the
/// robot place the patient themselves; they are compared with what the scan says.
pub(super) fn lay(
    given: Option<Posture>,
    room: &mut Scenario,
    resolved: &ResolvedScenario,
    built: &mut ScanBuild,
) {
    let scanned = built.seen.source.patient_position;
    let mut remarks = Vec::new();
    let pose = built.registered.as_ref().and_then(|registered| {
        let is_robot = registered.registration.frame == ReferenceFrame::Robot;
        let reference_from_ct = registered.registration.reference_from_ct;
        is_robot.then(|| {
            let world_from_robot = resolved.cell.robot.world_from_base_link;
            world_from_robot * reference_from_ct * PatientFrame::of(built).ct_from_phantom()
        })
    });
    if let Some(pose) = pose {
        let mut section = PhantomSection::default();
        section.set_pose(&pose);
        if let Some(scanned) = scanned
            && posture(scanned.lying) != section.posture
        {
            remarks.push(format!(
                "the markers place the patient {}, the scan was made {scanned}: check marker names and positions",
                word(section.posture)
            ));
        }
    } else {
        let phantom = room.phantom.get_or_insert_default();
        let wanted = given.or(scanned.map(|scanned| posture(scanned.lying)));
        if let (Some(given), Some(scanned)) = (given, scanned)
            && given != posture(scanned.lying)
        {
            remarks.push(format!(
                "--patient-position {} is taken; the scan was made {scanned}",
                word(given)
            ));
        }
        if let Some(wanted) = wanted
            && (wanted != phantom.posture || given.is_some())
        {
            if given.is_none() {
                remarks.push(format!(
                    "the patient lies {} as in the scan, not {} as in the room",
                    word(wanted),
                    word(phantom.posture)
                ));
            }
            phantom.posture = wanted;
            phantom.body_roll_deg = 0.0;
            phantom.head_up_deg = 0.0;
        }
        let scanned = scanned.filter(|_| given.is_none());
        let gantry = room.gantry.as_ref();
        remarks.extend(scanned.and_then(|scanned| turn(scanned, phantom, gantry)));
    }
    let remarks = remarks.into_iter().map(Remark::new);
    built
        .remarks
        .extend(remarks.map(|remark| remark.at("patient position")));
}

/// Turns the patient so that head or feet are towards the gantry, as the scan says.
fn turn(
    scanned: PatientPosition,
    phantom: &mut PhantomSection,
    gantry: Option<&GantrySection>,
) -> Option<String> {
    let Some(gantry) = gantry else {
        return (!scanned.head_first).then(|| {
            format!(
                "the scan was made {scanned}; the room has no gantry: the head points along its `phantom.head_yaw_deg`"
            )
        });
    };
    let (sine, cosine) = libm::sincos(phantom.head_yaw_deg.to_radians());
    let [x, y] = [0, 1].map(|axis| gantry.isocentre_mm[axis] - phantom.position_mm[axis]);
    let ahead_mm = x * cosine + y * sine;
    // Within the bore, neither end is nearer to it.
    let is_inside = ahead_mm.abs() <= 0.5 * gantry.depth_mm;
    if is_inside || (ahead_mm > 0.0) == scanned.head_first {
        return None;
    }
    phantom.head_yaw_deg += if phantom.head_yaw_deg > 0.0 {
        -180.0
    } else {
        180.0
    };
    Some(format!(
        "the scan was made {scanned}: the patient is turned, head_yaw_deg = {} instead of that of the room",
        phantom.head_yaw_deg
    ))
}
