"""Simulation testbench for needle-guide robots: feasible configurations, needle-tip accuracy, clearances.

```python
import needlebench as nb

scenario = nb.Scenario.load("table3.toml")
run = scenario.run(engines=["rapier"])
print(run.verdict, run["pose"].recommended)
```

Lengths are metres, angles radians, torques newton metres, times seconds; names end in their unit. Joint vectors are in
the order of `JOINT_NAMES`, the eight configurations in that of `CONFIGURATIONS`. The command line gives the same
results, bit for bit.
"""

from . import ct
from ._command import Answer, command
from ._compare import Comparison, compare
from ._errors import (
    CriterionFailed,
    EnvironmentFailed,
    Finding,
    InputError,
    Interrupted,
    NeedlebenchError,
)
from ._judge import judge, judge_answers, judge_free
from ._kinematics import Arm, ForwardKinematics, Poses, Solution, Solutions, fk, solve
from ._native import (
    ARMS,
    CERTIFICATES,
    CLEARANCE_CLASSES,
    CONFIGURATIONS,
    JOINT_NAMES,
    VERSION,
    IkAnswers,
    ik,
)
from ._run import Configuration, GoalResult, Plan, PlannedConfiguration, PlannedGoal, Run
from ._scenario import (
    Certificate,
    ClassCertificate,
    ClassClearance,
    Clearance,
    PairClearances,
    Scenario,
)
from ._study import Study, merge, study, study_shard

__version__ = VERSION

__all__ = [
    "ARMS",
    "CERTIFICATES",
    "CLEARANCE_CLASSES",
    "CONFIGURATIONS",
    "JOINT_NAMES",
    "Answer",
    "Arm",
    "Certificate",
    "ClassCertificate",
    "ClassClearance",
    "Clearance",
    "Comparison",
    "Configuration",
    "CriterionFailed",
    "EnvironmentFailed",
    "Finding",
    "ForwardKinematics",
    "GoalResult",
    "IkAnswers",
    "InputError",
    "Interrupted",
    "NeedlebenchError",
    "PairClearances",
    "Plan",
    "PlannedConfiguration",
    "PlannedGoal",
    "Poses",
    "Run",
    "Scenario",
    "Solution",
    "Solutions",
    "Study",
    "__version__",
    "command",
    "compare",
    "ct",
    "fk",
    "ik",
    "judge",
    "judge_answers",
    "judge_free",
    "merge",
    "solve",
    "study",
    "study_shard",
]
