//! The names that are built into the language, and what becomes of their calls.

use crate::call::Call;
use crate::functions::controller::{Elements, read, write};
use crate::functions::{arm, controller, math, matrices, poses, sockets, texts};
use crate::host::{Bank, Message};
use crate::live::{Live, LiveFunction, Reply};
use crate::machine::{Installation, Machine};
use crate::place::ScriptError;
use crate::value::Value;

/// A built-in function.
#[derive(Clone, Copy)]
pub(crate) struct Builtin {
    pub name: &'static str,
    /// Parameters in their order.
    pub parameters: &'static [&'static str],
    /// How many of them a call has to give.
    pub required: usize,
    /// Where no controller runs.
    pub does: Does,
    /// On a controller.
    pub runs: Runs,
}

/// What a call does where no controller runs.
#[derive(Clone, Copy)]
pub(crate) enum Does {
    /// Its arguments decide its value.
    Compute(fn(&Call) -> Result<Value, ScriptError>),
    /// It acts upon the arm, or reads what is known of it.
    Evaluate(fn(&mut Machine<'_>, &Call) -> Result<Value, ScriptError>),
    /// Nothing, with a note.
    Nothing(&'static str),
    /// It ends the evaluation.
    Refused(Reason),
}

/// What a call does on a controller.
#[derive(Clone, Copy)]
pub(crate) enum Runs {
    /// The same; what is refused is an exception.
    AsEvaluated,
    /// Something of its own.
    Call(LiveFunction),
    /// It reads an element of a bank.
    Read(Elements),
    /// It writes one.
    Write(Elements),
}

impl Builtin {
    /// The parameters are known.
    pub fn has_parameters(&self) -> bool {
        let is_unknown = matches!(self.does, Does::Nothing(_) | Does::Refused(_));
        !(is_unknown && matches!(self.runs, Runs::AsEvaluated))
    }

    /// Its calls change nothing on a controller either, and are noted.
    pub fn only_notes(&self) -> bool {
        matches!(
            (self.runs, self.does),
            (Runs::AsEvaluated, Does::Nothing(_))
        )
    }

    /// The first parameter that has to be given and is not.
    pub fn missing(&self, is_given: impl Fn(usize) -> bool) -> Option<&'static str> {
        let missing = (0..self.required).find(|index| !is_given(*index));
        missing.map(|index| self.parameters[index])
    }

    /// Evaluates a call where no controller runs.
    pub fn evaluate(&self, machine: &mut Machine<'_>, call: &Call) -> Result<Value, ScriptError> {
        match self.does {
            Does::Compute(function) => function(call),
            Does::Evaluate(function) => function(machine, call),
            Does::Nothing(_) | Does::Refused(_) => Ok(Value::Nothing),
        }
    }

    /// Does a call on a controller.
    pub fn run(&self, live: &mut Live<'_>, call: &Call) -> Result<Reply, ScriptError> {
        match (self.runs, self.does) {
            (Runs::Call(function), _) => function(live, call),
            (Runs::Read(elements), _) => read(live, call, elements),
            (Runs::Write(elements), _) => write(live, call, elements),
            (Runs::AsEvaluated, Does::Compute(function)) => function(call).map(Reply::Value),
            (Runs::AsEvaluated, Does::Evaluate(function)) => {
                let before = live.host.belief().clone();
                let (mut belief, installation) = (before.clone(), Installation::default());
                let mut machine = Machine::new(live, &installation, &mut belief).live();
                let value = function(&mut machine, call)?;
                let has_begun = machine.motions > 0;
                if belief != before {
                    live.host.set_belief(belief);
                }
                Ok(if has_begun {
                    Reply::Moving
                } else {
                    Reply::Value(value)
                })
            }
            (Runs::AsEvaluated, Does::Nothing(note)) => {
                let message = Message::NotSimulated(note);
                live.host.message(message, call.place);
                Ok(Reply::Value(Value::Nothing))
            }
            (Runs::AsEvaluated, Does::Refused(reason)) => {
                let reason = reason.in_words();
                Err(call.error(format!("it {reason}, which is not simulated")))
            }
        }
    }
}

/// Why a call is not evaluated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reason {
    Measured,
    Input,
    Network,
    Person,
    Force,
    Speed,
    Tracking,
    Planned,
    Chance,
    Clock,
    Safety,
    Language,
}

impl Reason {
    /// What the function does, and why that is not evaluated.
    pub fn in_words(self) -> &'static str {
        match self {
            Self::Measured => "reads the arm's measured state",
            Self::Input => "reads an input of the controller",
            Self::Network => "exchanges data with another device or program",
            Self::Person => "waits for a person's answer",
            Self::Force => "moves by forces, or with the arm's stiffness changed",
            Self::Speed => "moves at a speed until something stops it",
            Self::Tracking => "moves with a conveyor, or on an offset",
            Self::Planned => "moves on a course that only the controller knows",
            Self::Chance => "is random",
            Self::Clock => "reads the clock",
            Self::Safety => "depends on the robot's safety configuration, or changes its state",
            Self::Language => "is not evaluated",
        }
    }
}

/// What a note says of outputs where no controller runs.
const OUTPUTS: &str = "outputs, which nothing here reads";

const fn computed(
    name: &'static str,
    required: usize,
    parameters: &'static [&'static str],
    function: fn(&Call) -> Result<Value, ScriptError>,
) -> Builtin {
    let does = Does::Compute(function);
    live(name, required, parameters, does, Runs::AsEvaluated)
}

const fn evaluated(
    name: &'static str,
    required: usize,
    parameters: &'static [&'static str],
    function: fn(&mut Machine<'_>, &Call) -> Result<Value, ScriptError>,
) -> Builtin {
    let does = Does::Evaluate(function);
    live(name, required, parameters, does, Runs::AsEvaluated)
}

const fn live(
    name: &'static str,
    required: usize,
    parameters: &'static [&'static str],
    does: Does,
    runs: Runs,
) -> Builtin {
    Builtin {
        name,
        parameters,
        required,
        does,
        runs,
    }
}

/// What is evaluated or runs, by name.
static FUNCTIONS: [Builtin; 134] = [
    computed("acos", 1, &["f"], math::acos),
    computed("asin", 1, &["f"], math::asin),
    computed("atan", 1, &["f"], math::atan),
    computed("atan2", 2, &["x", "y"], math::atan2),
    computed("binary_list_to_integer", 1, &["l"], texts::of_bits),
    computed("ceil", 1, &["f"], math::ceil),
    computed("cos", 1, &["f"], math::cos),
    computed("d2r", 1, &["d"], math::d2r),
    computed("floor", 1, &["f"], math::floor),
    live(
        "force",
        0,
        &[],
        Does::Refused(Reason::Measured),
        Runs::Call(controller::force),
    ),
    live(
        "get_actual_joint_positions",
        0,
        &[],
        Does::Evaluate(arm::joints_before_the_first_motion),
        Runs::Call(|live, _| controller::joints(live, |state| &state.joints)),
    ),
    live(
        "get_actual_joint_positions_history",
        0,
        &["steps"],
        Does::Refused(Reason::Measured),
        Runs::Call(controller::joints_ago),
    ),
    live(
        "get_actual_joint_speeds",
        0,
        &[],
        Does::Refused(Reason::Measured),
        Runs::Call(|live, _| controller::joints(live, |state| &state.joint_speeds)),
    ),
    live(
        "get_actual_tcp_pose",
        0,
        &[],
        Does::Evaluate(arm::tcp_before_the_first_motion),
        Runs::Call(controller::tcp_pose),
    ),
    live(
        "get_actual_tcp_speed",
        0,
        &[],
        Does::Refused(Reason::Measured),
        Runs::Call(|live, _| controller::six(live, |state| &state.tool_speed)),
    ),
    live(
        "get_actual_tool_flange_pose",
        0,
        &[],
        Does::Evaluate(arm::flange_before_the_first_motion),
        Runs::Call(controller::flange_pose),
    ),
    live(
        "get_analog_in",
        1,
        &["n"],
        Does::Refused(Reason::Input),
        Runs::Read(Elements::all(Bank::AnalogInput)),
    ),
    live(
        "get_configurable_digital_in",
        1,
        &["n"],
        Does::Refused(Reason::Input),
        Runs::Read(Elements {
            bank: Bank::DigitalInput,
            first: 8,
            count: 8,
        }),
    ),
    live(
        "get_configurable_digital_out",
        1,
        &["n"],
        Does::Refused(Reason::Input),
        Runs::Read(Elements {
            bank: Bank::DigitalOutput,
            first: 8,
            count: 8,
        }),
    ),
    live(
        "get_digital_in",
        1,
        &["n"],
        Does::Refused(Reason::Input),
        Runs::Read(Elements::all(Bank::DigitalInput)),
    ),
    live(
        "get_digital_out",
        1,
        &["n"],
        Does::Refused(Reason::Input),
        Runs::Read(Elements::all(Bank::DigitalOutput)),
    ),
    live(
        "get_flag",
        1,
        &["n"],
        Does::Refused(Reason::Input),
        Runs::Read(Elements::all(Bank::Flag)),
    ),
    evaluated("get_forward_kin", 0, &["q", "tcp"], arm::forward),
    evaluated(
        "get_inverse_kin",
        1,
        &[
            "x",
            "qnear",
            "maxPositionError",
            "maxOrientationError",
            "tcp",
        ],
        arm::inverse,
    ),
    evaluated(
        "get_inverse_kin_has_solution",
        1,
        &[
            "pose",
            "qnear",
            "maxPositionError",
            "maxOrientationError",
            "tcp",
        ],
        arm::has_inverse,
    ),
    live(
        "get_joint_positions",
        0,
        &[],
        Does::Evaluate(arm::joints_before_the_first_motion),
        Runs::Call(|live, _| controller::joints(live, |state| &state.joints)),
    ),
    live(
        "get_joint_speeds",
        0,
        &[],
        Does::Refused(Reason::Measured),
        Runs::Call(|live, _| controller::joints(live, |state| &state.joint_speeds)),
    ),
    live(
        "get_joint_torques",
        0,
        &[],
        Does::Refused(Reason::Measured),
        Runs::Call(|live, _| controller::joints(live, |state| &state.joint_torques)),
    ),
    computed("get_list_length", 1, &["v"], texts::length),
    live(
        "get_robot_mode",
        0,
        &[],
        Does::Refused(Reason::Safety),
        Runs::Call(controller::robot_mode),
    ),
    live(
        "get_safety_mode",
        0,
        &[],
        Does::Refused(Reason::Safety),
        Runs::Call(controller::safety_mode),
    ),
    live(
        "get_standard_analog_in",
        1,
        &["n"],
        Does::Refused(Reason::Input),
        Runs::Read(Elements {
            bank: Bank::AnalogInput,
            first: 0,
            count: 2,
        }),
    ),
    live(
        "get_standard_analog_out",
        1,
        &["n"],
        Does::Refused(Reason::Input),
        Runs::Read(Elements::all(Bank::AnalogOutput)),
    ),
    live(
        "get_standard_digital_in",
        1,
        &["n"],
        Does::Refused(Reason::Input),
        Runs::Read(Elements {
            bank: Bank::DigitalInput,
            first: 0,
            count: 8,
        }),
    ),
    live(
        "get_standard_digital_out",
        1,
        &["n"],
        Does::Refused(Reason::Input),
        Runs::Read(Elements {
            bank: Bank::DigitalOutput,
            first: 0,
            count: 8,
        }),
    ),
    evaluated("get_steptime", 0, &[], arm::period),
    evaluated("get_target_joint_positions", 0, &[], arm::target_joints),
    live(
        "get_target_joint_speeds",
        0,
        &[],
        Does::Refused(Reason::Language),
        Runs::Call(|live, _| controller::joints(live, |state| &state.target_joint_speeds)),
    ),
    evaluated("get_target_payload", 0, &[], arm::payload),
    evaluated("get_target_tcp_pose", 0, &[], arm::target_tcp),
    live(
        "get_target_tcp_speed",
        0,
        &[],
        Does::Refused(Reason::Language),
        Runs::Call(|live, _| controller::six(live, |state| &state.target_tool_speed)),
    ),
    live(
        "get_tcp_force",
        0,
        &[],
        Does::Refused(Reason::Measured),
        Runs::Call(|live, _| controller::six(live, |state| &state.tool_force)),
    ),
    evaluated("get_tcp_offset", 0, &[], arm::tcp_offset),
    live(
        "get_tool_analog_in",
        1,
        &["n"],
        Does::Refused(Reason::Input),
        Runs::Read(Elements {
            bank: Bank::AnalogInput,
            first: 2,
            count: 2,
        }),
    ),
    live(
        "get_tool_digital_in",
        1,
        &["n"],
        Does::Refused(Reason::Input),
        Runs::Read(Elements {
            bank: Bank::DigitalInput,
            first: 16,
            count: 2,
        }),
    ),
    live(
        "get_tool_digital_out",
        1,
        &["n"],
        Does::Refused(Reason::Input),
        Runs::Read(Elements {
            bank: Bank::DigitalOutput,
            first: 16,
            count: 2,
        }),
    ),
    computed("integer_to_binary_list", 1, &["x"], texts::bits),
    computed(
        "interpolate_pose",
        3,
        &["p_from", "p_to", "alpha"],
        poses::interpolate,
    ),
    computed("inv", 1, &["m"], matrices::inverse),
    live(
        "is_steady",
        0,
        &[],
        Does::Refused(Reason::Measured),
        Runs::Call(controller::is_steady),
    ),
    live(
        "is_within_safety_limits",
        1,
        &["pose"],
        Does::Refused(Reason::Safety),
        Runs::Call(controller::is_within_limits),
    ),
    computed("length", 1, &["v"], texts::length),
    computed("log", 2, &["b", "f"], math::log),
    evaluated(
        "movec",
        2,
        &["pose_via", "pose_to", "a", "v", "r", "mode"],
        arm::movec,
    ),
    evaluated("movej", 1, &["q", "a", "v", "t", "r"], arm::movej),
    evaluated("movel", 1, &["pose", "a", "v", "t", "r"], arm::movel),
    evaluated("movep", 1, &["pose", "a", "v", "r"], arm::movep),
    computed("norm", 1, &["a"], math::norm),
    computed("normalize", 1, &["v"], math::normalize),
    live(
        "optimovej",
        1,
        &["q", "a", "v", "r"],
        Does::Refused(Reason::Planned),
        Runs::Call(controller::optimovej),
    ),
    live(
        "optimovel",
        1,
        &["pose", "a", "v", "r"],
        Does::Refused(Reason::Planned),
        Runs::Call(controller::optimovel),
    ),
    computed("point_dist", 2, &["p_from", "p_to"], poses::distance),
    live(
        "popup",
        1,
        &["s", "title", "warning", "error", "blocking"],
        Does::Evaluate(texts::popup),
        Runs::Call(controller::popup),
    ),
    computed("pose_add", 2, &["p_1", "p_2"], poses::add),
    computed("pose_dist", 2, &["p_from", "p_to"], poses::distance),
    computed("pose_inv", 1, &["p_from"], poses::inverse),
    computed("pose_sub", 2, &["p_to", "p_from"], poses::subtract),
    computed("pose_trans", 2, &["p_from", "p_from_to"], poses::transform),
    computed("pow", 2, &["base", "exponent"], math::pow),
    live(
        "protective_stop",
        0,
        &[],
        Does::Refused(Reason::Safety),
        Runs::Call(controller::protective_stop),
    ),
    computed("r2d", 1, &["r"], math::r2d),
    live(
        "read_input_boolean_register",
        1,
        &["address"],
        Does::Refused(Reason::Input),
        Runs::Read(Elements::all(Bank::InputBoolean)),
    ),
    live(
        "read_input_float_register",
        1,
        &["address"],
        Does::Refused(Reason::Input),
        Runs::Read(Elements::all(Bank::InputFloat)),
    ),
    live(
        "read_input_integer_register",
        1,
        &["address"],
        Does::Refused(Reason::Input),
        Runs::Read(Elements::all(Bank::InputInteger)),
    ),
    live(
        "read_output_boolean_register",
        1,
        &["address"],
        Does::Refused(Reason::Input),
        Runs::Read(Elements::all(Bank::OutputBoolean)),
    ),
    live(
        "read_output_float_register",
        1,
        &["address"],
        Does::Refused(Reason::Input),
        Runs::Read(Elements::all(Bank::OutputFloat)),
    ),
    live(
        "read_output_integer_register",
        1,
        &["address"],
        Does::Refused(Reason::Input),
        Runs::Read(Elements::all(Bank::OutputInteger)),
    ),
    computed(
        "rotvec2rpy",
        1,
        &["rotation_vector"],
        poses::rpy_from_vector,
    ),
    computed("rpy2rotvec", 1, &["rpy_vector"], poses::vector_from_rpy),
    live(
        "rtde_set_watchdog",
        2,
        &["variable_name", "min_frequency", "action"],
        Does::Refused(Reason::Network),
        Runs::Call(controller::set_watchdog),
    ),
    live(
        "servoc",
        1,
        &["pose", "a", "v", "r"],
        Does::Refused(Reason::Planned),
        Runs::Call(controller::servoc),
    ),
    evaluated(
        "servoj",
        1,
        &["q", "a", "v", "t", "lookahead_time", "gain"],
        arm::servoj,
    ),
    live(
        "set_analog_out",
        2,
        &["n", "f"],
        Does::Nothing(OUTPUTS),
        Runs::Write(Elements::all(Bank::AnalogOutput)),
    ),
    live(
        "set_configurable_digital_out",
        2,
        &["n", "b"],
        Does::Nothing(OUTPUTS),
        Runs::Write(Elements {
            bank: Bank::DigitalOutput,
            first: 8,
            count: 8,
        }),
    ),
    live(
        "set_digital_out",
        2,
        &["n", "b"],
        Does::Nothing(OUTPUTS),
        Runs::Write(Elements::all(Bank::DigitalOutput)),
    ),
    live(
        "set_flag",
        2,
        &["n", "b"],
        Does::Nothing(OUTPUTS),
        Runs::Write(Elements::all(Bank::Flag)),
    ),
    evaluated("set_gravity", 1, &["d"], arm::set_gravity),
    evaluated("set_payload", 1, &["m", "cog"], arm::set_payload),
    evaluated("set_payload_cog", 1, &["cog"], arm::set_centre),
    evaluated("set_payload_mass", 1, &["m"], arm::set_mass),
    live(
        "set_standard_analog_out",
        2,
        &["n", "f"],
        Does::Nothing(OUTPUTS),
        Runs::Write(Elements::all(Bank::AnalogOutput)),
    ),
    live(
        "set_standard_digital_out",
        2,
        &["n", "b"],
        Does::Nothing(OUTPUTS),
        Runs::Write(Elements {
            bank: Bank::DigitalOutput,
            first: 0,
            count: 8,
        }),
    ),
    evaluated(
        "set_target_payload",
        1,
        &["m", "cog", "inertia", "transition_time"],
        arm::set_payload,
    ),
    evaluated("set_tcp", 1, &["pose", "tcp_name"], arm::set_tcp),
    live(
        "set_tool_digital_out",
        2,
        &["n", "b"],
        Does::Nothing(OUTPUTS),
        Runs::Write(Elements {
            bank: Bank::DigitalOutput,
            first: 16,
            count: 2,
        }),
    ),
    computed("sin", 1, &["f"], math::sin),
    computed("size", 1, &["v"], matrices::size),
    live(
        "sleep",
        1,
        &["t"],
        Does::Evaluate(arm::sleep),
        Runs::Call(controller::sleep),
    ),
    live(
        "socket_close",
        0,
        &["socket_name"],
        Does::Refused(Reason::Network),
        Runs::Call(sockets::close),
    ),
    live(
        "socket_get_var",
        1,
        &["name", "socket_name"],
        Does::Refused(Reason::Network),
        Runs::Call(sockets::get_var),
    ),
    live(
        "socket_open",
        2,
        &["address", "port", "socket_name"],
        Does::Refused(Reason::Network),
        Runs::Call(sockets::open),
    ),
    live(
        "socket_read_ascii_float",
        1,
        &["number", "socket_name", "timeout"],
        Does::Refused(Reason::Network),
        Runs::Call(sockets::read_floats),
    ),
    live(
        "socket_read_binary_integer",
        1,
        &["number", "socket_name", "timeout"],
        Does::Refused(Reason::Network),
        Runs::Call(sockets::read_integers),
    ),
    live(
        "socket_read_byte_list",
        1,
        &["number", "socket_name", "timeout"],
        Does::Refused(Reason::Network),
        Runs::Call(sockets::read_bytes),
    ),
    live(
        "socket_read_line",
        0,
        &["socket_name", "timeout"],
        Does::Refused(Reason::Network),
        Runs::Call(sockets::read_line),
    ),
    live(
        "socket_read_string",
        0,
        &[
            "socket_name",
            "prefix",
            "suffix",
            "interpret_escape",
            "timeout",
        ],
        Does::Refused(Reason::Network),
        Runs::Call(sockets::read_string),
    ),
    live(
        "socket_send_byte",
        1,
        &["value", "socket_name"],
        Does::Refused(Reason::Network),
        Runs::Call(sockets::send_byte),
    ),
    live(
        "socket_send_int",
        1,
        &["value", "socket_name"],
        Does::Refused(Reason::Network),
        Runs::Call(sockets::send_int),
    ),
    live(
        "socket_send_line",
        1,
        &["str", "socket_name"],
        Does::Refused(Reason::Network),
        Runs::Call(sockets::send_line),
    ),
    live(
        "socket_send_string",
        1,
        &["str", "socket_name"],
        Does::Refused(Reason::Network),
        Runs::Call(sockets::send_string),
    ),
    live(
        "socket_set_var",
        2,
        &["name", "value", "socket_name"],
        Does::Refused(Reason::Network),
        Runs::Call(sockets::set_var),
    ),
    live(
        "speedj",
        1,
        &["qd", "a", "t"],
        Does::Refused(Reason::Speed),
        Runs::Call(controller::speedj),
    ),
    live(
        "speedl",
        1,
        &["xd", "a", "t", "aRot"],
        Does::Refused(Reason::Speed),
        Runs::Call(controller::speedl),
    ),
    computed("sqrt", 1, &["f"], math::sqrt),
    evaluated("stopj", 1, &["a"], arm::stopj),
    evaluated("stopl", 1, &["a", "aRot"], arm::stopl),
    computed("str_at", 2, &["src", "index"], texts::at),
    computed("str_cat", 2, &["op1", "op2"], texts::concatenate),
    computed("str_empty", 1, &["str"], texts::is_empty),
    computed("str_find", 2, &["src", "target", "start_from"], texts::find),
    computed("str_len", 1, &["str"], texts::length),
    computed("str_sub", 2, &["src", "index", "len"], texts::part),
    live(
        "sync",
        0,
        &[],
        Does::Evaluate(arm::sync),
        Runs::Call(controller::sync),
    ),
    computed("tan", 1, &["f"], math::tan),
    live(
        "textmsg",
        1,
        &["s1", "s2"],
        Does::Evaluate(texts::message),
        Runs::Call(controller::message),
    ),
    live(
        "time",
        0,
        &["mode"],
        Does::Refused(Reason::Clock),
        Runs::Call(controller::time),
    ),
    computed("to_num", 1, &["str"], texts::number),
    computed("to_str", 1, &["val"], texts::to_text),
    live(
        "tool_contact",
        0,
        &["direction"],
        Does::Refused(Reason::Measured),
        Runs::Call(controller::tool_contact),
    ),
    computed("transpose", 1, &["m"], matrices::transpose),
    live(
        "write_output_boolean_register",
        2,
        &["address", "value"],
        Does::Nothing(OUTPUTS),
        Runs::Write(Elements::all(Bank::OutputBoolean)),
    ),
    live(
        "write_output_float_register",
        2,
        &["address", "value"],
        Does::Nothing(OUTPUTS),
        Runs::Write(Elements::all(Bank::OutputFloat)),
    ),
    live(
        "write_output_integer_register",
        2,
        &["address", "value"],
        Does::Nothing(OUTPUTS),
        Runs::Write(Elements::all(Bank::OutputInteger)),
    ),
    live(
        "zero_ftsensor",
        0,
        &[],
        Does::Refused(Reason::Force),
        Runs::Call(controller::zero_force),
    ),
];

/// What changes nothing of the motion, with what is noted of it.
static NOTHING: [(&str, &[&str]); 3] = [
    (
        "settings of the controller that are not simulated",
        &[
            "modbus_set_digital_input_action",
            "modbus_set_output_runstate",
            "modbus_set_runstate_dependent_choice",
            "modbus_set_signal_update_frequency",
            "modbus_set_signal_watchdog",
            "set_analog_inputrange",
            "set_analog_outputdomain",
            "set_baselight_off",
            "set_baselight_on_default",
            "set_configurable_digital_input_action",
            "set_euromap_input_action",
            "set_euromap_runstate_dependent_choice",
            "set_gp_boolean_input_action",
            "set_gp_boolean_output_action",
            "set_input_actions_to_default",
            "set_runstate_configurable_digital_output_to_value",
            "set_runstate_gp_boolean_output_to_value",
            "set_runstate_standard_analog_output_to_value",
            "set_runstate_standard_digital_output_to_value",
            "set_runstate_tool_digital_output_to_value",
            "set_safety_mode_transition_hardness",
            "set_standard_analog_input_domain",
            "set_standard_digital_input_action",
            "set_target_payload_inertia",
            "set_tool_analog_input_domain",
            "set_tool_communication",
            "set_tool_digital_input_action",
            "set_tool_digital_output_mode",
            "set_tool_output_mode",
            "set_tool_voltage",
        ],
    ),
    (
        OUTPUTS,
        &[
            "modbus_set_output_register",
            "modbus_set_output_signal",
            "set_euromap_output",
            "write_port_bit",
            "write_port_register",
        ],
    ),
    ("messages to a person, answered at once", &["beep"]),
];

/// What is known and not evaluated, with the reason.
static REFUSED: [(Reason, &[&str]); 11] = [
    (
        Reason::Measured,
        &[
            "get_actual_payload",
            "get_conf_estimated_payload",
            "get_controller_temp",
            "get_joint_temp",
            "get_tool_accelerometer_reading",
            "get_tool_current",
            "estimate_payload",
            "get_actual_joint_accelerations",
        ],
    ),
    (
        Reason::Input,
        &[
            "encoder_get_tick_count",
            "get_euromap_input",
            "get_euromap_output",
            "read_port_bit",
            "read_port_register",
        ],
    ),
    (
        Reason::Network,
        &[
            "interpreter_mode",
            "clear_interpreter",
            "end_interpreter",
            "get_interpreter_status",
            "modbus_add_rtu_signal",
            "eip_reader_factory",
            "eip_writer_factory",
            "get_rtde_value",
            "modbus_add_rw_signal",
            "modbus_add_signal",
            "modbus_delete_signal",
            "modbus_get_error",
            "modbus_get_signal_error",
            "modbus_get_signal_status",
            "modbus_get_time_since_signal_invalid",
            "modbus_reset_connection",
            "modbus_send_custom_command",
            "rpc_factory",
            "profinet_set_watchdog",
            "eip_set_watchdog",
        ],
    ),
    (
        Reason::Person,
        &[
            "request_boolean_from_primary_client",
            "request_float_from_primary_client",
            "request_integer_from_primary_client",
            "request_string_from_primary_client",
        ],
    ),
    (
        Reason::Force,
        &[
            "direct_torque",
            "end_force_mode",
            "end_freedrive_mode",
            "end_screw_driving",
            "end_teach_mode",
            "enable_external_ft_sensor",
            "force_mode",
            "force_mode_example",
            "force_mode_set_damping",
            "force_mode_set_gain_scaling",
            "freedrive_mode",
            "freedrive_mode_no_incorrect_payload_check",
            "ft_rtde_input_enable",
            "get_freedrive_status",
            "screw_driving",
            "teach_mode",
        ],
    ),
    (
        Reason::Tracking,
        &[
            "conveyor_pulse_decode",
            "encoder_enable_pulse_decode",
            "encoder_enable_set_tick_count",
            "encoder_set_tick_count",
            "encoder_unwind_delta_tick_count",
            "get_conveyor_tick_count",
            "path_offset_disable",
            "path_offset_enable",
            "path_offset_get",
            "path_offset_set",
            "path_offset_set_alpha_filter",
            "path_offset_set_max_offset",
            "reset_revolution_counter",
            "reset_world_model",
            "set_conveyor_tick_count",
            "stop_conveyor_tracking",
            "track_conveyor_circular",
            "track_conveyor_linear",
        ],
    ),
    (Reason::Planned, &["pause_on_error_code"]),
    (Reason::Chance, &["random"]),
    (Reason::Clock, &["get_robot_uptime"]),
    (
        Reason::Safety,
        &[
            "position_deviation_warning",
            "powerdown",
            "set_unlock_protective_stop",
            "unlock_protective_stop",
        ],
    ),
    (
        Reason::Language,
        &[
            "get_coriolis_and_centrifugal_torques",
            "get_gravity_torques",
            "get_jacobian",
            "get_jacobian_time_derivative",
            "get_mass_matrix",
            "get_target_payload_cog",
            "get_target_payload_inertia",
            "get_target_waypoint",
            "tool_contact_examples",
            "wrench_trans",
            "assert",
            "quit",
            "struct",
        ],
    ),
];

/// The built-in function of a name.
pub(crate) fn builtin(name: &str) -> Option<Builtin> {
    if let Some(found) = FUNCTIONS.iter().find(|each| each.name == name) {
        return Some(*found);
    }
    let other = |name, does| Builtin {
        name,
        parameters: &[],
        required: 0,
        does,
        runs: Runs::AsEvaluated,
    };
    for (note, names) in &NOTHING {
        if let Some(name) = names.iter().find(|each| **each == name) {
            return Some(other(name, Does::Nothing(note)));
        }
    }
    for (reason, names) in &REFUSED {
        if let Some(name) = names.iter().find(|each| **each == name) {
            return Some(other(name, Does::Refused(*reason)));
        }
    }
    None
}
