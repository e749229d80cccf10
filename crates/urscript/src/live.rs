//! One call of a built-in function on a controller.

use needlebench_kinematics::Pose;

use crate::call::Call;
use crate::host::{Host, Request};
use crate::place::{Place, ScriptError};
use crate::value::Value;

/// What a call acts upon.
pub(crate) struct Live<'a> {
    pub host: &'a mut dyn Host,
    /// Why the thread may not move the arm now.
    pub standing: Option<&'static str>,
    /// Time since the call was first tried, s.
    pub waited_s: f64,
}

/// What follows a call.
#[derive(Debug)]
pub(crate) enum Reply {
    /// The thread goes on.
    Value(Value),
    /// It goes on in the next cycle.
    NextCycle,
    /// It goes on after a time, s.
    Sleep(f64),
    /// It goes on when the host is done with what was begun.
    Moving,
    /// The same call again in the next cycle.
    Again,
    /// The program ends in a protective stop.
    ProtectiveStop,
}

pub(crate) type LiveFunction = fn(&mut Live<'_>, &Call) -> Result<Reply, ScriptError>;

impl Live<'_> {
    /// Gives the host something that moves the arm.
    pub fn begin(&mut self, request: &Request, place: Place) -> Result<Reply, ScriptError> {
        let refused = match self.standing {
            Some(reason) => Err(reason.to_owned()),
            None => self.host.begin(request, place),
        };
        refused.map_err(|reason| ScriptError::new(place, reason))?;
        Ok(Reply::Moving)
    }

    /// The tool's point in the flange's frame.
    pub fn tcp(&self, call: &Call) -> Result<Pose, ScriptError> {
        let known = self.host.belief().flange_from_tcp;
        known.ok_or_else(|| {
            let reason =
                "the program sets no TCP before this, and that of the installation is not known";
            call.error(reason)
                .hint("add set_tcp(p[...]) to the program, or say with --tcp which point it is")
        })
    }
}
