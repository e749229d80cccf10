//! The client of the Python process that steps MuJoCo.

mod answers;
mod watchdog;
mod wire;

use std::io::{self, Read, Write};
use std::process::{ChildStdin, ChildStdout, Command, Stdio};
use std::time::Duration;

use super::environment::{Environment, harness_override};
use super::tail::Tail;
use crate::EngineError;
pub use answers::{
    ContactSummary, GeomDistance, HarnessState, HarnessVersions, InverseDynamics, PlantHandle,
    Replay,
};
use watchdog::Watchdog;
use wire::{ERROR_KIND, Frame, HEADER_BYTES, MAX_PAYLOAD_BYTES, Malformed, Payload, Request};

/// Answers up to this size arrive with a single read.
const ANSWER_BYTES: usize = 1 << 14;

/// Why the harness process could not do what was asked.
///
/// After every variant but [`Self::Engine`], [`Self::Length`] and [`Self::TooLarge`] the process
/// is of no further use, and later requests return the same error.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum HarnessError {
    /// The command could not be started at all.
    #[error("cannot start the MuJoCo harness `{command}`: {reason}")]
    Start {
        /// The command line.
        command: String,
        /// What the operating system says.
        reason: String,
    },
    /// The process ended before it answered.
    #[error(
        "the MuJoCo harness died during {during} ({status}){}",
        quoted(stderr_tail)
    )]
    Died {
        /// Name of the request.
        during: &'static str,
        /// Exit status or signal.
        status: String,
        /// The last that it wrote to standard error.
        stderr_tail: String,
    },
    /// The process did not answer in time and was killed.
    #[error(
        "the MuJoCo harness gave no answer to {during} for {seconds} s and was killed{}",
        quoted(stderr_tail)
    )]
    TimedOut {
        /// The limit, s.
        seconds: f64,
        /// Name of the request.
        during: &'static str,
        /// The last that it wrote to standard error.
        stderr_tail: String,
    },
    /// The process answered what the protocol does not allow.
    #[error(
        "the MuJoCo harness answered {during} with {got}, expected {expected}{}",
        quoted(stderr_tail)
    )]
    Protocol {
        /// Name of the request.
        during: &'static str,
        /// What the protocol allows here.
        expected: String,
        /// What came.
        got: String,
        /// The last that it wrote to standard error.
        stderr_tail: String,
    },
    /// MuJoCo refused the request: a model that does not compile, an unstable simulation.
    #[error("MuJoCo failed during {during}: {message}")]
    Engine {
        /// Name of the request.
        during: &'static str,
        /// MuJoCo's own words.
        message: String,
    },
    /// A vector of the wrong length was to be sent.
    #[error("{what} has {got} values, the model requires {expected}")]
    Length {
        /// Which vector.
        what: &'static str,
        /// Values that the model needs.
        expected: usize,
        /// Values that were given.
        got: usize,
    },
    /// A model too large for the protocol was to be sent.
    #[error("the model takes {bytes} bytes, the harness accepts {limit}")]
    TooLarge {
        /// Size of the request.
        bytes: usize,
        /// Largest size allowed.
        limit: usize,
    },
}

impl HarnessError {
    /// Whether the process is of no further use.
    pub(crate) fn ends_the_process(&self) -> bool {
        !matches!(
            self,
            Self::Engine { .. } | Self::Length { .. } | Self::TooLarge { .. }
        )
    }
}

impl From<HarnessError> for EngineError {
    fn from(error: HarnessError) -> Self {
        let reason = error.to_string();
        if error.ends_the_process() {
            Self::Lost { reason }
        } else {
            Self::Refused { reason }
        }
    }
}

fn quoted(stderr_tail: &str) -> String {
    if stderr_tail.is_empty() {
        String::new()
    } else {
        format!("; last output:\n{stderr_tail}")
    }
}

/// One plant's part of a message that steps several.
#[derive(Debug, Clone, Copy)]
pub(super) struct GroupStep<'a> {
    pub plant: &'a PlantHandle,
    /// Whether MuJoCo is to look for contacts.
    pub look: bool,
    /// Joint torques, N m.
    pub tau: &'a [f64],
}

/// A running harness, which holds any number of plants and serves one request after the other.
///
/// A watchdog kills the process when an answer takes longer than the time limit. Dropping the value
/// asks the process to quit, and kills it if it does not.
#[derive(Debug)]
pub struct HarnessProcess {
    requests: Option<ChildStdin>,
    answers: ChildStdout,
    watchdog: Watchdog,
    stderr: Tail,
    versions: HarnessVersions,
    outbox: Vec<u8>,
    inbox: Vec<u8>,
    failure: Option<HarnessError>,
}

impl HarnessProcess {
    /// Starts the harness in its environment; each answer may take `timeout`.
    ///
    /// The first answer includes the start of Python and the import of MuJoCo: about 0.4 s, several
    /// seconds from a cold disk.
    ///
    /// For tests and debugging, the environment variable `NEEDLEBENCH_HARNESS_COMMAND` replaces the
    /// command: words separated by blanks, double quotes around a word that contains some. The
    /// command must become the harness (`exec` in a shell), since only the process itself is killed
    /// when it is late.
    pub fn start(environment: &Environment, timeout: Duration) -> Result<Self, HarnessError> {
        if let Some(words) = harness_override() {
            let mut command = Command::new(&words[0]);
            command.args(&words[1..]);
            return Self::start_command(command, timeout);
        }
        let mut command = Command::new(&environment.python);
        // Isolated: a PYTHONPATH (ROS sets one) or the user's own packages must not get in.
        // Bytecode is sealed, so none is written.
        command.args(["-I", "-B", "-m", "needlebench_harness"]);
        // The harness is one thread of work; numpy's pools would only slow its start.
        command.env("OMP_NUM_THREADS", "1");
        command.env("OPENBLAS_NUM_THREADS", "1");
        Self::start_command(command, timeout)
    }

    /// Starts any command that speaks the harness protocol on its standard input and output.
    pub fn start_command(mut command: Command, timeout: Duration) -> Result<Self, HarnessError> {
        let start_error = |reason: io::Error, command: &Command| HarnessError::Start {
            command: format!("{command:?}"),
            reason: reason.to_string(),
        };
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|reason| start_error(reason, &command))?;
        let (Some(requests), Some(answers), Some(stderr)) =
            (child.stdin.take(), child.stdout.take(), child.stderr.take())
        else {
            unreachable!("all three streams were asked to be piped");
        };
        let mut process = Self {
            requests: Some(requests),
            answers,
            watchdog: Watchdog::of(child, timeout),
            stderr: Tail::of(stderr),
            versions: HarnessVersions::default(),
            outbox: Vec::new(),
            inbox: vec![0; ANSWER_BYTES],
            failure: None,
        };
        let frame = Frame::begin(&mut process.outbox, Request::Hello).u32(wire::PROTOCOL_VERSION);
        let sealed = frame.finish();
        process.versions = process.ask(Request::Hello, sealed, answers::versions)?;
        Ok(process)
    }

    /// Versions of what runs in the process.
    pub fn versions(&self) -> &HarnessVersions {
        &self.versions
    }

    /// Operating system's id of the process.
    pub fn process_id(&self) -> u32 {
        self.watchdog.process_id()
    }

    /// Why the process is of no further use, if it is not.
    pub fn failure(&self) -> Option<&HarnessError> {
        self.failure.as_ref()
    }

    /// Forgets all plants and models, so that a process can serve one cell after the other without
    /// growing. Handles from before name plants that are gone, or others.
    pub fn clear(&mut self) -> Result<(), HarnessError> {
        let sealed = Frame::begin(&mut self.outbox, Request::Clear).finish();
        self.ask(Request::Clear, sealed, answers::nothing)
    }

    /// Compiles an MJCF model, whose site `observed_site` every state will report.
    pub fn load(&mut self, mjcf: &str, observed_site: &str) -> Result<PlantHandle, HarnessError> {
        let site_bytes = u32::try_from(observed_site.len()).unwrap_or(u32::MAX);
        let sealed = Frame::begin(&mut self.outbox, Request::Load)
            .u32(site_bytes)
            .bytes(observed_site.as_bytes())
            .bytes(mjcf.as_bytes())
            .finish();
        self.ask(Request::Load, sealed, answers::plant)
    }

    /// Sets the plant's state at time zero, at rest in every other respect.
    ///
    /// `qpos` and `qvel` in rad and rad/s (m and m/s for slides), in the model's order.
    pub fn reset(
        &mut self,
        plant: &PlantHandle,
        qpos: &[f64],
        qvel: &[f64],
    ) -> Result<HarnessState, HarnessError> {
        check_length("qpos", plant.qpos_count, qpos)?;
        check_length("qvel", plant.dof_count, qvel)?;
        let sealed = Frame::begin_for_plant(&mut self.outbox, Request::Reset, plant.index)
            .f64s(qpos)
            .f64s(qvel)
            .finish();
        self.ask(Request::Reset, sealed, |p| answers::state(p, plant))
    }

    /// A plant of the same compiled model with a state of its own, which has to be reset first.
    pub fn copy(&mut self, plant: &PlantHandle) -> Result<PlantHandle, HarnessError> {
        let sealed = Frame::begin_for_plant(&mut self.outbox, Request::Copy, plant.index).finish();
        self.ask(Request::Copy, sealed, |p| answers::copy(p, plant))
    }

    /// Advances the plant by one time step under the joint torques `tau`, N m (N for slides).
    pub fn step(&mut self, plant: &PlantHandle, tau: &[f64]) -> Result<HarnessState, HarnessError> {
        self.step_looking(plant, true, tau)
    }

    /// The same; with `look` false the caller vouches that nothing can touch during the step, and
    /// MuJoCo does not look for contacts.
    pub(super) fn step_looking(
        &mut self,
        plant: &PlantHandle,
        look: bool,
        tau: &[f64],
    ) -> Result<HarnessState, HarnessError> {
        check_length("tau", plant.dof_count, tau)?;
        let sealed = Frame::begin(&mut self.outbox, Request::Step)
            .plant(plant.index, u32::from(look))
            .f64s(tau)
            .finish();
        self.ask(Request::Step, sealed, |p| answers::state(p, plant))
    }

    /// Advances several plants, each as [`Self::step_looking`] would, with one message each way.
    ///
    /// `states` gets one entry per plant. The failures are the places of the plants that became
    /// unstable, with MuJoCo's words; what is in `states` there means nothing, and only a reset
    /// mends such a plant. The others are not concerned.
    pub(super) fn step_group(
        &mut self,
        steps: &[GroupStep<'_>],
        states: &mut Vec<HarnessState>,
    ) -> Result<Vec<(usize, String)>, HarnessError> {
        for step in steps {
            check_length("tau", step.plant.dof_count, step.tau)?;
        }
        let count = u32::try_from(steps.len()).unwrap_or(u32::MAX);
        let mut frame = Frame::begin(&mut self.outbox, Request::StepGroup)
            .u32(count)
            .u32(0);
        for step in steps {
            frame = frame.plant(step.plant.index, u32::from(step.look));
        }
        for step in steps {
            frame = frame.f64s(step.tau);
        }
        let sealed = frame.finish();
        self.ask(Request::StepGroup, sealed, |p| {
            answers::group_state(p, steps.iter().map(|step| step.plant), states)
        })
    }

    /// Runs MuJoCo's own step over rows of torques from the plant's present state, in a loop that
    /// does nothing else, and measures it: what lock-step has to be compared with.
    ///
    /// `tau` holds the torques of one step after the other. With `look` false MuJoCo does not look
    /// for contacts.
    pub fn replay(
        &mut self,
        plant: &PlantHandle,
        look: bool,
        tau: &[f64],
    ) -> Result<Replay, HarnessError> {
        let rows = tau.len().checked_div(plant.dof_count).unwrap_or(0);
        check_length("tau", rows * plant.dof_count, tau)?;
        let sealed = Frame::begin(&mut self.outbox, Request::Replay)
            .plant(plant.index, u32::from(look))
            .f64s(tau)
            .finish();
        self.ask(Request::Replay, sealed, |p| answers::replay(p, plant))
    }

    /// MuJoCo's rigid-body dynamics at a state; the plant's running state is not touched.
    ///
    /// `qacc` in rad/s^2. Without contacts, limits, friction, damping; with armature.
    pub fn inverse(
        &mut self,
        plant: &PlantHandle,
        qpos: &[f64],
        qvel: &[f64],
        qacc: &[f64],
    ) -> Result<InverseDynamics, HarnessError> {
        check_length("qpos", plant.qpos_count, qpos)?;
        check_length("qvel", plant.dof_count, qvel)?;
        check_length("qacc", plant.dof_count, qacc)?;
        let sealed = Frame::begin_for_plant(&mut self.outbox, Request::Inverse, plant.index)
            .f64s(qpos)
            .f64s(qvel)
            .f64s(qacc)
            .finish();
        self.ask(Request::Inverse, sealed, |p| answers::dynamics(p, plant))
    }

    /// MuJoCo's signed distance of two geoms (indices into [`PlantHandle::geom_names`]) at the
    /// plant's running state; `None` beyond `cutoff_m`.
    pub fn distance(
        &mut self,
        plant: &PlantHandle,
        geoms: [u32; 2],
        cutoff_m: f64,
    ) -> Result<Option<GeomDistance>, HarnessError> {
        let sealed = Frame::begin_for_plant(&mut self.outbox, Request::Distance, plant.index)
            .u32(geoms[0])
            .u32(geoms[1])
            .f64s(&[cutoff_m])
            .finish();
        self.ask(Request::Distance, sealed, |p| {
            answers::distance(p, cutoff_m)
        })
    }

    /// Sends the sealed request in the outbox and reads its answer.
    fn ask<T>(
        &mut self,
        request: Request,
        sealed: Result<(), usize>,
        read: impl FnOnce(Payload<'_>) -> Result<T, Malformed>,
    ) -> Result<T, HarnessError> {
        if let Some(failure) = &self.failure {
            return Err(failure.clone());
        }
        sealed.map_err(|bytes| HarnessError::TooLarge {
            bytes,
            limit: MAX_PAYLOAD_BYTES,
        })?;
        self.watchdog.arm();
        let arrived = self.exchange();
        self.watchdog.disarm();
        let error = match arrived {
            Ok((kind, end)) if kind == request.answer_kind() => {
                if let Ok(value) = read(Payload(&self.inbox[HEADER_BYTES..end])) {
                    return Ok(value);
                }
                let got = format!("{} bytes that do not decode", end - HEADER_BYTES);
                self.protocol_error(request, got)
            }
            Ok((ERROR_KIND, end)) => {
                let message = String::from_utf8_lossy(&self.inbox[HEADER_BYTES..end]);
                return Err(HarnessError::Engine {
                    during: request.name(),
                    message: message.trim().to_owned(),
                });
            }
            Ok((kind, end)) => {
                let bytes = end - HEADER_BYTES;
                let got = format!("a frame of kind {kind:#x} and {bytes} bytes");
                self.protocol_error(request, got)
            }
            Err(Broken::Oversized { kind, length }) => {
                let got = format!("a frame of kind {kind:#x} that claims {length} bytes");
                self.protocol_error(request, got)
            }
            Err(Broken::Surplus { bytes }) => {
                let got = format!("{bytes} bytes behind the answer");
                self.protocol_error(request, got)
            }
            Err(Broken::Ended) => self.death(request),
        };
        self.failure = Some(error.clone());
        Err(error)
    }

    /// One request out, one frame in: its kind, and where it ends in the inbox.
    fn exchange(&mut self) -> Result<(u32, usize), Broken> {
        // A write fails when the reader is gone; it may have left its reason in the pipe, and if
        // not, the read below finds the end of the stream.
        if let Some(requests) = &mut self.requests {
            let _ = requests.write_all(&self.outbox);
        }
        let mut received = 0;
        let mut kind = 0;
        let mut end = HEADER_BYTES;
        while received < end {
            let count = match self.answers.read(&mut self.inbox[received..]) {
                Ok(0) => return Err(Broken::Ended),
                Ok(count) => count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(_) => return Err(Broken::Ended),
            };
            let header_is_new = received < HEADER_BYTES;
            received += count;
            if header_is_new && received >= HEADER_BYTES {
                let mut header = Payload(&self.inbox);
                let (Ok(frame_kind), Ok(length)) = (header.u32(), header.u32()) else {
                    unreachable!("the inbox is larger than a header");
                };
                kind = frame_kind;
                let length = length as usize;
                if length > MAX_PAYLOAD_BYTES {
                    return Err(Broken::Oversized { kind, length });
                }
                end = HEADER_BYTES + length;
                if end > self.inbox.len() {
                    self.inbox.resize(end, 0);
                }
            }
        }
        if received > end {
            let bytes = received - end;
            return Err(Broken::Surplus { bytes });
        }
        Ok((kind, end))
    }

    /// The error for an answer that makes no sense; the process is not asked again.
    fn protocol_error(&mut self, request: Request, got: String) -> HarnessError {
        // At the end of its input it ends, and with it its standard error.
        self.requests = None;
        let _ = self.watchdog.reap();
        HarnessError::Protocol {
            during: request.name(),
            expected: format!("a well-formed frame of kind {:#x}", request.answer_kind()),
            got,
            stderr_tail: self.stderr.after_exit(),
        }
    }

    /// The error for an answer that did not come.
    fn death(&mut self, request: Request) -> HarnessError {
        self.requests = None;
        let status = match self.watchdog.reap() {
            Ok(status) => status.to_string(),
            Err(error) => format!("exit status unknown: {error}"),
        };
        let during = request.name();
        let stderr_tail = self.stderr.after_exit();
        if self.watchdog.expired() {
            return HarnessError::TimedOut {
                seconds: self.watchdog.limit().as_secs_f64(),
                during,
                stderr_tail,
            };
        }
        HarnessError::Died {
            during,
            status,
            stderr_tail,
        }
    }
}

impl Drop for HarnessProcess {
    fn drop(&mut self) {
        if let Some(mut requests) = self.requests.take()
            && Frame::begin(&mut self.outbox, Request::Quit)
                .finish()
                .is_ok()
        {
            // A pipe holds a frame of eight bytes even if nobody reads; a broken one needs no farewell.
            let _ = requests.write_all(&self.outbox);
        }
        // Nobody is left to hear of a child that cannot be waited for.
        let _ = self.watchdog.reap();
    }
}

/// Why no frame came.
#[derive(Debug)]
enum Broken {
    Ended,
    Oversized { kind: u32, length: usize },
    Surplus { bytes: usize },
}

fn check_length(what: &'static str, expected: usize, values: &[f64]) -> Result<(), HarnessError> {
    if values.len() == expected {
        return Ok(());
    }
    Err(HarnessError::Length {
        what,
        expected,
        got: values.len(),
    })
}
