//! The table of states and requests.

use needlebench_controller::{
    Command, Controller, Event, Measured, Order, Origin, Outcome, Refusal, Request, State, TABLE,
};
use needlebench_kinematics::Joints;

use crate::{Cell, arm, movej, pace, start};

fn command(order: Order) -> Command {
    match order {
        Order::PowerOn => Command::PowerOn,
        Order::ReleaseBrakes => Command::ReleaseBrakes,
        Order::PowerOff => Command::PowerOff,
        Order::ProtectiveStop => Command::ProtectiveStop,
        Order::Unlock => Command::Unlock,
        Order::PressEmergencyStop => Command::PressEmergencyStop,
        Order::ReleaseEmergencyStop => Command::ReleaseEmergencyStop,
        Order::OpenSafeguard => Command::OpenSafeguard,
        Order::CloseSafeguard => Command::CloseSafeguard,
        Order::Play => Command::Play,
        Order::Pause => Command::Pause,
        Order::Stop => Command::Stop,
        Order::SetSpeed => Command::SetSpeed(0.5),
        Order::Move => movej(start(), pace(1.0, 1.0), 0.0),
    }
}

fn cell_in(state: State) -> Cell {
    let mut cell = Cell::new(0.008);
    let way: &[Command] = match state {
        State::PowerOff => &[Command::PowerOff],
        State::PoweringOn | State::Idle => &[Command::PowerOff, Command::PowerOn],
        State::Starting | State::Releasing => &[Command::PowerOff, Command::ReleaseBrakes],
        State::Stopped => &[],
        State::Playing => &[Command::Play],
        State::Paused => &[Command::Play, Command::Pause],
        State::Protective => &[Command::ProtectiveStop],
        State::Safeguard => &[Command::OpenSafeguard],
        State::SafeguardPaused => &[Command::Play, Command::OpenSafeguard],
        State::Emergency => &[Command::PressEmergencyStop],
    };
    for what in way {
        cell.ask(what.clone());
    }
    if matches!(state, State::Idle | State::Releasing) {
        cell.wait(0.312);
    }
    assert_eq!(cell.controller.state(), state);
    cell.events.clear();
    cell
}

/// Every state with every request, as the controller answers it: what the table says, and nothing else.
#[test]
fn every_request_in_every_state_has_the_outcome_of_the_table() {
    for (row, state) in TABLE.iter().zip(State::ALL) {
        assert_eq!(row.0, state);
        for (outcome, order) in row.1.iter().zip(Order::ALL) {
            assert_eq!(state.outcome(order), *outcome);
            let mut cell = cell_in(state);
            let found = cell.ask(command(order)).state;
            let refused = cell.refusals();
            let (expected, refusal) = match *outcome {
                Outcome::To(next) | Outcome::AtRest(next) => (next, None),
                Outcome::Stay => (state, None),
                Outcome::No => (state, Some(Refusal::State { state, order })),
                Outcome::Unlock(_) => (
                    state,
                    Some(Refusal::TooEarly {
                        left_s: 5.0 - 0.008,
                    }),
                ),
            };
            assert_eq!(found, expected, "{state:?} {order:?}");
            match (refused.as_slice(), refusal) {
                ([], None) => {}
                (
                    [Refusal::TooEarly { left_s }],
                    Some(Refusal::TooEarly { left_s: expected_s }),
                ) => {
                    assert!((left_s - expected_s).abs() < 1e-9);
                }
                ([found], Some(expected)) => assert_eq!(*found, expected),
                (found, expected) => panic!("{state:?} {order:?}: {found:?}, not {expected:?}"),
            }
        }
    }
}

/// What must hold of any such table.
#[test]
fn emergencies_count_always_and_programs_move_the_arm_alone() {
    for (state, row) in TABLE {
        let emergency = row[Order::PressEmergencyStop as usize];
        let is_one = state == State::Emergency && emergency == Outcome::Stay;
        assert!(is_one || emergency == Outcome::To(State::Emergency));
        let may_move = row[Order::Move as usize] == Outcome::Stay;
        assert_eq!(may_move, state.runtime_state() != 1, "{state:?}");
        for (outcome, order) in row.iter().zip(Order::ALL) {
            let next = match outcome {
                Outcome::To(next) | Outcome::AtRest(next) | Outcome::Unlock(next) => *next,
                Outcome::Stay | Outcome::No => continue,
            };
            assert_ne!(next, state);
            // Nothing but the brakes' release gives the arm to its drives.
            assert!(
                !state.is_braked() || next.is_braked(),
                "{state:?} {order:?}"
            );
            // A program starts or goes on by play alone.
            assert!(next != State::Playing || order == Order::Play);
        }
    }
}

/// The numbers that clients of the real-time data exchange see (its guide, and the design's list).
#[test]
fn modes_and_bits_are_those_of_the_real_time_data_exchange() {
    let of = |state: State| {
        let modes = [state.robot_mode(), state.safety_mode()];
        let bits = [state.robot_status_bits(), state.safety_status_bits()];
        (modes, state.runtime_state(), bits)
    };
    assert_eq!(of(State::PowerOff), ([3, 1], 1, [0, 1]));
    assert_eq!(of(State::PoweringOn), ([4, 1], 1, [0, 1]));
    assert_eq!(of(State::Starting), ([4, 1], 1, [0, 1]));
    assert_eq!(of(State::Idle), ([5, 1], 1, [1, 1]));
    assert_eq!(of(State::Releasing), ([5, 1], 1, [1, 1]));
    assert_eq!(of(State::Stopped), ([7, 1], 1, [1, 1]));
    assert_eq!(of(State::Playing), ([7, 1], 2, [3, 1]));
    assert_eq!(of(State::Paused), ([7, 1], 4, [1, 1]));
    assert_eq!(of(State::Protective), ([7, 3], 1, [1, 1028]));
    assert_eq!(of(State::Safeguard), ([7, 5], 1, [1, 1040]));
    assert_eq!(of(State::SafeguardPaused), ([7, 5], 4, [1, 1040]));
    assert_eq!(of(State::Emergency), ([3, 7], 1, [0, 1216]));
}

#[test]
fn powering_on_and_releasing_take_their_times() {
    for period_s in [0.002, 0.008] {
        let mut cell = Cell::new(period_s);
        cell.ask(Command::PowerOff);
        let begin_s = cell.controller.time_s();
        cell.ask(Command::ReleaseBrakes);
        let mut at_s = Vec::new();
        while cell.controller.state() != State::Stopped {
            let cycle = cell.cycle(&[]);
            let changed = |event: &Event| matches!(event, Event::State { .. });
            if cycle.events.iter().any(changed) {
                at_s.push(cycle.time_s - period_s - begin_s);
            }
        }
        // The first start of a cycle at which 0.3 s have passed.
        let whole_s = (0.3 / period_s).ceil() * period_s;
        assert!((at_s[0] - whole_s).abs() < 1e-9, "{at_s:?}");
        assert!((at_s[1] - 2.0 * whole_s).abs() < 1e-9, "{at_s:?}");
    }
}

#[test]
fn a_protective_stop_is_unlocked_after_five_seconds_of_the_faster_clock() {
    // Robot time alone.
    let mut cell = Cell::new(0.002);
    cell.ask(Command::ProtectiveStop);
    cell.wait(4.996);
    cell.ask(Command::Unlock);
    let [Refusal::TooEarly { left_s }] = cell.refusals()[..] else {
        panic!("not too early");
    };
    assert!((left_s - 0.002).abs() < 1e-9, "{left_s}");
    assert_eq!(cell.ask(Command::Unlock).state, State::Stopped);
    // On a late machine five seconds of the wall pass earlier.
    let mut cell = Cell::new(0.002);
    cell.wall_s = 70.0;
    cell.ask(Command::ProtectiveStop);
    cell.wall_s = 74.9;
    assert_eq!(cell.ask(Command::Unlock).state, State::Protective);
    cell.wall_s = 75.0;
    assert_eq!(cell.ask(Command::Unlock).state, State::Stopped);
    // But not while the arm moves.
    let mut cell = Cell::playing(0.002);
    cell.wall_s = 70.0;
    cell.ask(crate::speedj(Joints::repeat(1.0), 5.0, None));
    cell.wait(1.0);
    cell.ask(Command::ProtectiveStop);
    cell.wall_s = 80.0;
    cell.ask(Command::Unlock);
    assert_eq!(cell.refusals(), [Refusal::StillMoving]);
}

#[test]
fn requests_take_effect_in_the_order_given() {
    let mut cell = Cell::new(0.002);
    let mut requests: Vec<Request> = [Command::Pause, Command::Play, Command::Stop]
        .into_iter()
        .zip([(1, 0, 9), (0, 7, 3), (0, 7, 4)])
        .map(|(what, (door, client, arrival))| Request {
            from: Origin {
                door,
                client,
                arrival,
            },
            what,
        })
        .collect();
    // Nothing plays yet.
    cell.cycle(&requests[..1]);
    assert_eq!(cell.refusals().len(), 1);
    requests.sort_by_key(|request| request.from);
    let cycle = cell.cycle(&requests);
    // Played, stopped, and then there is nothing to pause.
    assert_eq!(cycle.state, State::Stopped);
    assert_eq!(cell.refusals().len(), 2);
}

#[test]
fn data_of_no_arm_are_refused() {
    let good = arm(0.002);
    assert!(Controller::new(&good, start(), true).is_ok());
    for period_s in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(Controller::new(&arm(period_s), start(), true).is_err());
    }
    let mut bad = good;
    bad.acceleration_rad_s2[4] = f64::NAN;
    assert!(Controller::new(&bad, start(), true).is_err());
    let mut bad = good;
    bad.servo_delay_s = -0.001;
    assert!(Controller::new(&bad, start(), true).is_err());
    for outside in [7.0, f64::NAN] {
        let mut posture = start();
        posture[2] = outside;
        let error = Controller::new(&good, posture, true).unwrap_err();
        assert!(error.to_string().starts_with("elbow starts at"), "{error}");
    }
}

/// While the brakes are released the set-point moves to where the arm is, slowly where that is far.
#[test]
fn a_released_arm_is_held_where_it_is() {
    let arm = arm(0.002);
    let mut controller = Controller::new(&arm, start(), false).unwrap();
    let measured = Measured {
        position: start() + Joints::from([0.0, 0.3, -0.01, 0.0, 0.0, f64::NAN]),
        wall_s: f64::NAN,
    };
    let request = Request {
        from: Origin {
            door: 0,
            client: 0,
            arrival: 0,
        },
        what: Command::ReleaseBrakes,
    };
    let mut before = controller.cycle(&measured, &[request]).set_point;
    let mut fastest = 0.0_f64;
    while controller.state() != State::Stopped {
        assert!(controller.time_s() < 3.0);
        let now = controller.cycle(&measured, &[]).set_point;
        let mean = (now.position - before.position) / arm.period_s;
        let middle = (now.velocity + before.velocity) * 0.5;
        assert!((mean - middle).amax() < 1e-4);
        fastest = fastest.max(now.velocity.amax());
        before = now;
    }
    let off = controller.set_point().position - measured.position;
    assert!(off.fixed_rows::<5>(0).amax() < 1e-12);
    assert!((controller.set_point().position[5] - start()[5]).abs() < 1e-15);
    assert!(fastest < 0.2 * arm.limits.0[1].velocity_rad_s + 1e-9);
}
