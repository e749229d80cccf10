//! Stops, pauses and limits.

use nalgebra::Vector3;
use needlebench_controller::{Command, Event, State, Trip};
use needlebench_kinematics::{Joints, Pose};

use crate::{Cell, STOP, movej, movel, pace, servoj, speedj, start};

fn ways(cell: &Cell) -> Vec<(Joints, f64)> {
    let stopping = |event: &Event| match event {
        Event::Stopping { way_rad, time_s } => Some((*way_rad, *time_s)),
        _ => None,
    };
    cell.events.iter().filter_map(stopping).collect()
}

fn cruising() -> (Cell, Joints) {
    let mut cell = Cell::playing(0.002);
    let delta = Joints::from([1.5, 0.0, 0.3, -0.6, 0.0, 1.0]);
    cell.ask(movej(start() + delta, pace(3.0, 1.2), 0.0));
    cell.wait(0.9);
    assert!((cell.controller.set_point().velocity[0] - 1.2).abs() < 1e-12);
    (cell, delta)
}

/// `v^2 / 2a + v r / 2` on the move's own line, as told, whatever stops the arm.
#[test]
fn stops_take_the_stated_way_on_the_line_of_the_move() {
    let stops = [
        (Command::ProtectiveStop, State::Protective),
        (Command::PressEmergencyStop, State::Emergency),
        (Command::PowerOff, State::PowerOff),
        (Command::Stop, State::Stopped),
    ];
    for (what, state) in stops {
        let (mut cell, delta) = cruising();
        let at = cell.position();
        assert_eq!(cell.ask(what).state, state);
        cell.wait(1.0);
        assert!(cell.controller.is_steady());
        let way = cell.position() - at;
        let (v, a, r) = (1.2, STOP.deceleration_rad_s2, STOP.ramp_s);
        let expected = delta / delta[0] * (0.5 * v * v / a + 0.5 * v * r);
        assert!((way - expected).amax() < 1e-9, "{way} {expected}");
        let [(told, time_s)] = ways(&cell)[..] else {
            panic!("told once");
        };
        assert!((told - way).amax() < 1e-9);
        assert!((time_s - (v / a + r)).abs() < 1e-9);
        let cancelled = |event: &&Event| matches!(event, Event::Cancelled { .. });
        assert_eq!(cell.events.iter().filter(cancelled).count(), 1);
        // Nothing moves any more, and no program moves the arm.
        let stands = cell.position();
        cell.ask(movej(start(), pace(1.0, 1.0), 0.0));
        cell.wait(0.5);
        assert_eq!(cell.position(), stands);
        assert_eq!(cell.refusals().len(), 1);
    }
}

#[test]
fn a_paused_move_stands_on_its_way_and_goes_on_to_its_end() {
    let (mut cell, delta) = cruising();
    let at = cell.position();
    cell.ask(Command::Pause);
    cell.wait(1.5);
    assert!(cell.controller.set_point().velocity.amax() <= 0.0);
    // Its own acceleration, 3 rad/s^2, slows it down.
    let way = cell.position() - at;
    assert!(
        (way[0] - (0.5 * 1.2 * 1.2 / 3.0 + 0.5 * 1.2 * 0.14)).abs() < 1e-6,
        "{way}"
    );
    cell.ask(Command::Play);
    cell.finish();
    assert!((cell.position() - start() - delta).amax() < 1e-12);
    for state in cell.record.states() {
        let share = (state.position[0] - start()[0]) / delta[0];
        assert!((state.position - start() - delta * share).amax() < 1e-12);
        assert!(state.acceleration.amax() < 6.0 + 1e-9);
    }
}

#[test]
fn what_goes_by_speed_is_stopped_in_a_pause_and_begun_again() {
    let mut cell = Cell::playing(0.002);
    let speed = Joints::from([0.5, 0.0, 0.0, -0.5, 0.0, 0.0]);
    cell.ask(speedj(speed, 3.0, Some(1.0)));
    cell.wait(0.5);
    cell.ask(Command::OpenSafeguard);
    cell.wait(0.5);
    assert!(cell.controller.is_steady());
    assert_eq!(cell.controller.state(), State::SafeguardPaused);
    cell.ask(Command::CloseSafeguard);
    assert_eq!(cell.controller.state(), State::Paused);
    cell.ask(Command::Play);
    let done = |event: &Event| matches!(event, Event::Done { .. });
    assert!(!cell.events.iter().any(done));
    cell.wait(0.51);
    assert!(cell.events.iter().any(done));
    assert!((cell.controller.set_point().velocity - speed).amax() < 1e-12);
}

#[test]
fn half_the_speed_of_the_slider_takes_twice_as_long() {
    let took_s = [1.0, 0.5].map(|rate| {
        let mut cell = Cell::playing(0.002);
        cell.ask(Command::SetSpeed(rate));
        cell.ask(movej(start() + Joints::repeat(0.5), pace(2.0, 1.0), 0.0));
        cell.finish()
    });
    assert!((took_s[1] - 2.0 * took_s[0]).abs() < 0.004, "{took_s:?}");
    for rate in [0.0, 1.1, f64::NAN] {
        let mut cell = Cell::playing(0.002);
        cell.ask(Command::SetSpeed(rate));
        assert_eq!(cell.refusals().len(), 1);
        assert!((cell.controller.speed() - 1.0).abs() < 1e-15);
    }
}

#[test]
fn a_joint_stops_before_its_limit_and_says_which() {
    let mut cell = Cell::playing(0.002);
    let mut to = start();
    to[1] = -7.0;
    cell.ask(movej(to, pace(3.0, 2.0), 0.0));
    cell.wait(10.0);
    let limit = cell.arm.limits.0[1].lower_rad;
    let Some(Trip::Position {
        joint: 1,
        value_rad,
        limit_rad,
    }) = cell.trip()
    else {
        panic!("{:?}", cell.trip());
    };
    assert!(value_rad < limit && (limit_rad - limit).abs() < 1e-15);
    let text = cell.trip().unwrap().to_string();
    assert!(text.starts_with("shoulder_lift would stop at"), "{text}");
    assert_eq!(cell.controller.state(), State::Protective);
    // Within a period's way of the limit, and not beyond.
    let left = cell.position()[1] - limit;
    assert!((0.0..2.0 * 0.002).contains(&left), "{left}");
}

#[test]
fn speeds_beyond_the_limit_are_a_protective_stop() {
    let mut cell = Cell::playing(0.002);
    let mut speed = Joints::zeros();
    speed[0] = 4.0;
    cell.ask(speedj(speed, 10.0, None));
    cell.wait(2.0);
    let Some(Trip::Speed {
        joint: 0,
        limit_rad_s,
        ..
    }) = cell.trip()
    else {
        panic!("{:?}", cell.trip());
    };
    assert!((limit_rad_s - std::f64::consts::PI).abs() < 1e-12);
    assert!(cell.peaks(0).0 <= limit_rad_s * (1.0 + 1e-9));
    // A target of servoj that is too far away.
    let mut cell = Cell::playing(0.002);
    cell.ask(servoj(start() + Joints::repeat(2.0), 0.002));
    cell.wait(2.0);
    assert!(
        matches!(cell.trip(), Some(Trip::Speed { .. })),
        "{:?}",
        cell.trip()
    );
    assert!(cell.peaks(0).0 <= limit_rad_s * (1.0 + 1e-9));
}

#[test]
fn lines_out_of_reach_and_through_singularities_are_protective_stops() {
    let from = Cell::new(0.002).base_from_tcp(&start());
    let far = Pose::from_parts((from.translation.vector * 3.0).into(), from.rotation);
    // Through the axis of the shoulder, which the wrist's centre cannot pass.
    let mirrored = Vector3::new(-1.0, -1.0, 1.0).component_mul(&from.translation.vector);
    let through = Pose::from_parts(mirrored.into(), from.rotation);
    for to in [far, through] {
        let mut cell = Cell::playing(0.002);
        cell.ask(movel(to, pace(1.2, 0.25), 0.0));
        cell.wait(10.0);
        let singular = cell.events.iter().find_map(|event| match event {
            Event::Trip {
                least_singular_value,
                ..
            } => *least_singular_value,
            _ => None,
        });
        // At the start it is 0.2 and more.
        let singular = singular.expect("a tool's way");
        assert!(singular < 0.15, "{singular} {:?}", cell.trip());
        assert_eq!(cell.controller.state(), State::Protective);
        assert!(cell.controller.is_steady());
    }
}
