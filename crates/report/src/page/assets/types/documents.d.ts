// What a page is given: the parts of its document that its scripts read. `page/run.rs` and those beside it write it;
// `report` is `report.json`.

type NumberArray =
  | Uint8Array<ArrayBuffer>
  | Uint16Array<ArrayBuffer>
  | Uint32Array<ArrayBuffer>
  | Float32Array<ArrayBuffer>
  | Float64Array<ArrayBuffer>;

/** An array of the payload: `page/pack.rs` says what its keys mean. */
interface Packed {
  t: 'u8' | 'u16' | 'u32' | 'f32' | 'f64';
  n: number;
  at: number;
  step?: number;
  low?: number;
  d?: number;
  h?: number;
  p?: number;
}

/** A surface, quantised along each axis. */
interface Surface {
  low: Point;
  step: Point;
  vertices: Packed;
  triangles: Packed;
}

interface Part {
  group: string;
  /** Link that it is on; -1 for the room, -2 for what goes along with the base. */
  frame: number;
  color: Colour;
  surface: Surface;
}

interface Chain {
  base: Pose;
  joints: { pose: Pose; axis: Point }[];
  flange: Pose;
}

interface Scene {
  chain: Chain;
  parts: Part[];
  /** Entry and exit of the tool's guide, from the flange; for tests. */
  guide: Pose[];
  needleLength: number;
}

interface Person {
  name: string;
  position: Point;
  shortest: number;
  /** By stature. */
  eyes: { [stature: string]: Point };
}

/** What all documents have. */
interface PageDocument {
  words?: { [name: string]: string };
}

interface MetricColumn {
  title: string;
  unit: string;
  format: Formats;
  keys: string[];
  help: string;
}

interface Provenance {
  version: string;
  git_revision: string;
  seed: number;
  truth: string;
  cargo_lock_sha256: string;
  engines: { name: string; version: string; settings: [key: string, value: string][] }[];
  inputs: InputFile[];
}

interface InputFile {
  role?: string;
  file: string;
  sha256: string;
}

// ---- a run

interface RunDocument extends PageDocument {
  report: Report;
  scene: Scene;
  start: number[];
  /** The chain of the real arm, which recorded motions are of. */
  realChain: Chain;
  classesAround: string[];
  explore: ExploreData;
  goals: GoalExtra[];
  counts: string;
  /** Notes on what the verdict rests on. */
  qualifying: string[];
  /** What is said of a motion from a file; nothing of planned ones. */
  judged: JudgedPart[] | null;
  /** Indices of criteria. */
  missedAsExpected: number[];
  iso9283: TestCharts | null;
}

/** Sentences, or a table. */
interface JudgedPart {
  lines?: string[];
  header?: string[];
  rows?: string[][];
}

/** What the report does not have of a goal. */
interface GoalExtra {
  columns: { table: MetricColumn[]; side: MetricColumn[] };
  trueTarget: string | null;
  guideExit: Pose;
  charts: { ranking: string | null };
  room: { people: Person[]; sector: { center: Point; outwards: Point; radius: number } | null };
  configurations: ConfigurationExtra[];
}

interface ConfigurationExtra {
  runs: MotionRun[];
  flange: Pose | null;
  charts: ConfigurationCharts;
  room: { guideEntry: Pose; sight: Packed; taken: Surface | null } | null;
}

interface ConfigurationCharts {
  budget: string | null;
  press: (string | null)[] | null;
}

interface MotionRun {
  engine: string;
  stopped: boolean;
  time: Packed;
  joints: Packed[];
  curveTime: Packed;
  curves: { [name: string]: Packed };
  nearest: { classes: string[]; names: string[][]; pair: Packed; points: Packed[]; time: Packed } | null;
  decoded?: DecodedRun;
}

/** The arrays of a motion, once they were wanted. */
interface DecodedRun {
  time: NumberArray;
  joints: NumberArray[];
  curveTime: NumberArray;
  curves: [name: string, values: NumberArray][];
  nearest?: { classes: string[]; names: string[][]; pair: NumberArray; points: NumberArray[]; time: NumberArray };
}

/** What trying postures needs. */
interface ExploreData {
  base: Base;
  bodies: { name: string; kind: string; link: number | null; solids: string[] }[];
  classes: { name: string; judged: number | null; unwanted: boolean }[];
  /** Two bodies and the class. */
  pairs: number[][];
  joints: number[][];
  configurations: string[];
  goals: { free: boolean; fromBase: boolean }[];
  code: Packed;
  scene: Packed;
}

/** What `crates/live` exports. */
interface LiveCode extends WebAssembly.Exports {
  memory: WebAssembly.Memory;
  input(bytes: number): number;
  load(): number;
  results(): number;
  message(): number;
  pairs(): number;
  lowest(): number;
  place_base(): number;
  reset_base(): void;
  overlaps(): number;
  reach(goal: number, rolls: number): number;
  mount_surface(): number;
}

/** The clearance of a pair of bodies at a posture. */
interface LivePair {
  index: number;
  class: number;
  bodies: number[];
  distance: number;
  points: Point[];
  solids: string[];
}

/** A configuration at a goal. */
interface LivePosture {
  label: string;
  outcome: string;
  roll: number;
  surplus: number;
  joints: number[] | null;
  pair: number | null;
  distance: number;
}

/** Where the base stands: mm; roll, pitch, yaw in degrees. */
interface Base {
  position: Point;
  rpy: number[];
}

interface TestCharts {
  commanded: Point[];
  engines: { engine: string; attained: string; stabilisation: string; offsets: Packed[] }[];
}

interface Report {
  scenario: { name: string; file: string };
  verdict: string;
  engine_failures: { engine: string; during: string | null; message: string }[];
  goals: GoalReport[];
  criteria: CriterionResult[];
  not_judged: NotJudged[];
  trace?: RequirementTrace[];
  notes: string[];
  truth: object | null;
  provenance: Provenance;
  excitation?: object;
  iso9283?: TestReport;
}

interface CriterionResult {
  criterion: string;
  goal: string;
  label: string | null;
  engine: string | null;
  value: number | null;
  limit: number | null;
  unit: string;
  pass: boolean;
  detail: string;
}

interface NotJudged {
  criterion: string;
  goal: string;
  label: string | null;
  engine: string | null;
  reason: string;
}

interface RequirementTrace {
  requirement: string;
  criterion: string;
  outcome: 'met' | 'missed' | 'not_judged';
  met: number;
  missed: number;
  not_judged: number;
}

interface GoalReport {
  name: string;
  axis: Point;
  target_m: Point;
  entry_m: Point | null;
  recommended: { label: string; reason: string } | null;
  needle_route: {
    part: string;
    tissue: string;
    distance_m: number;
    margin_m: number;
    kept: boolean;
  } | null;
  fissures_crossed?: string[];
  needle?: { summary: string; path_in_world_m: Point[] };
  configurations: ConfigurationReport[];
}

/** How likely an event is: of 1000 needles, in words. */
interface EventProbability {
  probability: number | null;
  of_1000: string;
  at_most_of_1000?: string;
  assumed_larger?: { of_1000: string };
  mostly?: string;
}

interface StructureProbability extends EventProbability {
  structure: string;
  tissue: string;
  distance_m: number;
}

interface Probability {
  in_lesion?: EventProbability & { lesion: string; diameter_m: number };
  within_2_mm: EventProbability;
  structures: StructureProbability[];
  any: EventProbability | null;
  margin_m: number;
  assumed: string[];
}

type WithProbability = ConfigurationReport & { probability: Probability };

interface ConfigurationReport {
  label: string;
  status: 'ok' | 'failed' | 'rejected';
  joints_rad: number[] | null;
  roll_rad: number | null;
  not_judged: number;
  rejections: Rejection[];
  metrics: { [key: string]: number };
  clearance: Clearances;
  retreat_clearance: Clearances;
  margin: Margin | null;
  motion: { phase: string; start_s: number; end_s: number }[];
  ranking: { rank: number; score: number } | null;
  pareto: boolean;
  dominated_by: { label: string } | null;
  engine_difference: { peak_tip_m: number } | null;
  budget: Budget | null;
  probability?: Probability;
  budget_failure: string | null;
  room: RoomReport | null;
  events?: Events;
}

interface Rejection {
  rule: string;
  value: number | null;
  limit: number | null;
  unit: string;
  engine?: undefined;
  detail: string;
}

/** The least clearance of a class. */
interface ClassMinimum {
  minimum_m: number;
  certified_lower_bound_m: number | null;
  pair: string[];
  phase: string;
  time_s: number | null;
  witness_points_m: Point[];
}

/** What is nearest, of which class, at a time. */
type Nearest = Pick<ClassMinimum, 'minimum_m' | 'pair' | 'time_s' | 'witness_points_m'> & { name: string };

/** Where one looks from; what is absent is as at home. */
interface Viewpoint {
  direction: Point;
  distance?: number;
  middle?: Point;
}

/** By class, and the least of all. */
type Clearances = { [name: string]: ClassMinimum | undefined } & {
  minimum_m: number | null;
  minimum_certified_m: number | null;
};

interface Margin {
  search: 'bound' | 'proof' | 'budget';
  classes: {
    [name: string]: { limit_m: number; attainable_m: number; achieved_m: number; limited_by: string };
  };
}

/** Moments of where the tip is, across the needle and along it. */
interface Moments {
  rms_m: number;
  bias_m: number[];
  covariance_m2: number[][];
}

interface BudgetPart {
  source: string | null;
  at_skin?: { analytic: Moments } | null;
  at_target: { analytic: Moments; radius_95_m: number | null };
}

interface Budget {
  dominant: string | null;
  total: BudgetPart;
  sources: BudgetPart[];
}

/** What a configuration leaves to the people in the room. */
interface RoomReport {
  free_fraction: number;
  regions: { [name: string]: number };
  sight: Sight[];
  hand_cone_half_angle_rad: number;
  hand_cone_length_m: number;
  hand_cone_blocker: string | null;
  elbow_up: boolean;
  elbow_over_entry_m: number;
}

interface Sight {
  person: string;
  person_in_words: string;
  stature_m: number;
  fraction: number;
  entry_fraction: number;
  needle_fraction: number;
  accuracy: number;
  blocker: string | null;
}

interface Events {
  press: Press[];
  stop: Stop | null;
  /** By engine. */
  retract: { [engine: string]: Retract };
}

interface Press {
  solids: string[];
  friction: number;
  force_means: string;
  not_staged: string | null;
  engines: { [engine: string]: PressMeasured };
  force_difference: number | null;
  tip_difference_settled_m: number | null;
}

interface PressMeasured {
  episodes: {
    start_s: number;
    approach_speed_m_s: number;
    peak_force_n: number;
    impulse_ns: number;
    deepest_penetration_m: number;
  }[];
  settled_force_n: number | null;
  balance_difference: number | null;
  recovery_s: number | null;
}

interface Stop {
  phase: string;
  at_s: number;
  category: number;
  brakes: { fit: string } | null;
  engines: { [engine: string]: StopMeasured };
  envelope: { worst_tip_distance_m: number; worst_stopping_time_s: number };
}

interface StopMeasured {
  stopping_time_s: number;
  tip_distance_m: number;
  flange_distance_m: number;
  off_path_m: number;
  clearance: Clearances;
}

interface Retract {
  inserted_length_m: number;
  straight_length_m: number;
  needle_clears: boolean;
  largest_lateral_deviation_m: number;
  largest_angle_rad: number;
  contacts: object[];
  clearance: Clearances;
}

/** A test by ISO 9283. */
interface TestReport {
  protocol: {
    configuration: string;
    speed_share: number;
    load_kg: number;
    tracker_noise_m: number;
    joints_rad: number[][];
  };
  engines: { [engine: string]: TestMeasured };
}

interface TestMeasured {
  ap_m: number;
  rp_m: number;
  vap_m: number | null;
  peak_torque_ratio: number;
  cycles_simulated: number;
  remark: string | null;
  poses: { pose: number; count: number; ap_m: number; ap_xyz_m: number[]; rp_m: number }[];
  stabilisation: Settled[];
  directional: { pose: number; vap_m: number }[];
  drift: { pose: number; dap_m: number; drp_m: number } | null;
}

/** A row of the table of poses. */
interface PoseRow {
  pose: TestMeasured['poses'][number];
  settled?: Settled;
  direction?: TestMeasured['directional'][number];
}

interface Settled {
  pose: number;
  time_s: number | null;
  after_motion_s: number | null;
  overshoot_m: number | null;
}

// ---- an atlas

interface AtlasDocument extends PageDocument {
  scenario: string;
  scene: Scene;
  provenance: Provenance;
  ruleColors: { [rule: string]: string };
  goals: AtlasGoal[];
}

interface AtlasGoal {
  name: string;
  target: Point;
  entry: Point | null;
  axis: Point;
  guideExit: Pose;
  aim: string;
  fixedRoll: number | null;
  rolls: number;
  branches: Branch[];
}

/** A configuration over the roll about the needle. */
interface Branch {
  label: string;
  ranges: RollRange[];
  /** Codes of `ruleNames`; 255 where it works. */
  rules: Packed;
  ruleNames: string[];
  joints: Packed[];
  surplus: Packed;
  curves: { [name: string]: Packed };
  decoded?: BranchArrays;
}

interface BranchArrays {
  rules: NumberArray;
  joints: NumberArray[];
  surplus: NumberArray;
  curves: [name: string, values: NumberArray][];
}

type DecodedBranch = Omit<Branch, keyof BranchArrays> & BranchArrays;

interface RollRange {
  from_rad: number;
  to_rad: number;
  width_rad: number;
  is_whole_circle: boolean;
  before: { rule: string; detail: string } | null;
  after: { rule: string; detail: string } | null;
  /** By what it is best at. */
  best: { [aim: string]: { roll_rad: number; least_clearance_m: number; pair: string[] | null } };
}

// ---- a search

interface SearchDocument extends PageDocument {
  name: string;
  factors: SearchFactor[];
  objectives: { words: string; unit: string; moreIsBetter: boolean }[];
  pictures: {
    id: number;
    address: string;
    choice: string;
    configuration: string;
    goal: string;
    marginMm: number;
  }[];
  search: SearchLog;
}

/** What is chosen: one of levels, or out of a range. */
interface SearchFactor {
  name: string;
  words: string;
  unit: string;
  key: string | null;
  levels: (number | string)[] | null;
  range: [low: number, high: number] | null;
}

interface SearchLog {
  answer: SearchAnswer;
  candidates: Candidate[];
  generations: Generation[];
  classes: string[];
  samples: number;
  cases: number;
  cases_spared: number;
  ruled_out: number;
  grid_cases: number | null;
}

/** An estimate with the ends of its interval, where they are known. */
interface Estimate {
  value: number | null;
  cases: number;
  interval: { low: number | null; high: number | null };
}

interface SearchAnswer {
  winner: number;
  figures: Estimate[];
  rate: Estimate;
  selected_by: Estimate[];
  equals: number[];
  undecided: number[];
  front?: FrontMember[] | null;
}

interface FrontMember {
  id: number;
  is_certain: boolean;
  by_estimate: boolean;
  fresh: Estimate[] | null;
}

interface Candidate {
  id: number;
  cases: number;
  choice: [name: string, value: number | string][];
  figures: Estimate[];
  rate: Estimate;
}

interface Generation {
  generation: number;
  purpose: string;
  stream: string;
  cases: number;
  circumstances: number[];
  candidates: { id: number; figures: (number | null)[] }[];
}

// ---- a study

interface StudyDocument extends PageDocument {
  name: string;
  /** As it stands in the command that reruns a case. */
  file: string;
  cases: number;
  /** Cases that are on the page. */
  kept: number;
  /** Of the cases that are kept, each less the one before it; null where all are. */
  numbers: Packed | null;
  configurations: string[];
  factors: StudyFactor[];
  metrics: StudyMetric[];
  outcomes: Packed;
  outcomeNames: [outcome: string, detail: string, words: string][];
  postures: { cases: Packed; joints: Packed };
  scene?: Scene | null;
  looks?: Looks;
  summary?: StudySummary;
  manifest?: Manifest;
}

interface Level {
  label: string;
  number: number | null;
}

interface StudyFactor {
  name: string;
  words: string;
  unit: string;
  role: string;
  levels: Level[] | null;
  column: Packed;
}

interface StudyMetric {
  name: string;
  words: string;
  unit: string;
  description: string;
  measure: string | null;
  column: Packed;
}

/** What cases look like: codes of tools and things, and places, case by case. */
interface Looks {
  tools: { parts: Part[]; guide: Pose[] }[];
  kinds: Part[][];
  slots: number;
  arms: Packed;
  toolOf: Packed;
  things: Packed;
  places: Packed;
  bases: Packed;
  targets: Packed;
}

interface Manifest {
  seed?: number;
  inputs?: { [file: string]: string };
  provenance?: { version?: string; source_sha256?: string | null; seed?: number; arithmetic?: string };
}

interface Interval {
  low: number;
  high: number;
}

/** A share of layouts. */
interface Rate {
  rate: number | null;
  interval: Interval | null;
  remark?: string | null;
}

/** `summary.json`. */
interface StudySummary {
  verdict?: string;
  headline?: string | null;
  confidence?: number;
  postures_only?: 'all' | 'some' | 'none';
  without_route?: boolean;
  not_judged?: string[];
  study_id?: string;
  sampling?: string;
  repeats?: number;
  answer?: { sentence: string; remarks: string[]; compared?: ComparedLevels[] } | null;
  criteria?: StudyCriterion[];
  metrics?: { name: string; words: string; unit: string }[];
  choices?: ChoiceRanking | null;
  of_choice?: { label: string; of: number } | null;
  overall?: Counts;
  goals?: Counts[];
  spreads?: Spread[];
  effects?: Effects | null;
  regions?: Regions | null;
  robustness?: RobustnessResult[] | null;
  replanned?: Replanned | null;
  evidence?: Evidence | null;
  notes?: string[];
  methods?: { numbers: string; method: string; source: string }[];
}

interface StudyCriterion {
  criterion: string;
  pass: boolean;
  of: string | null;
  value: number | null;
  interval: Interval | null;
  unit: string;
  limit: number;
  requirement?: string | null;
  choice?: string | null;
  detail: string;
  confidence: boolean;
  cases?: number[];
}

/** Levels of a factor, held against each other. */
interface ComparedLevels {
  factor: string;
  response: string;
  unit: string;
  differs: boolean;
  levels: { label: string; value: number | null; interval: Interval | null; small: boolean }[];
}

interface Axis {
  factor: number;
  name: string;
  unit: string;
  coarse: boolean;
  bins: Bin[];
}

interface Bin {
  label: string;
  low: number | null;
  high: number | null;
}

interface Quantile {
  p: number;
  value: number | null;
  interval: Interval | null;
  remark: string | null;
}

interface ChoiceRanking {
  axes: Axis[];
  choices: Choice[];
  working_configurations: number;
  ranked_by: string;
}

interface Choice {
  label: string;
  bins: number[];
  cases: number;
  invalid: number;
  works: Rate;
  works_k: Rate;
  against_first: { difference: number; distinguishable: boolean; interval: Interval | null } | null;
  best_clearance_mm: Quantile | null;
  tip_error_mm: Quantile | null;
  failing?: number[];
}

interface Counts {
  goal: string | null;
  cases: number;
  layouts?: number;
  invalid: number;
  configurations: ConfigurationCounts[];
}

interface ConfigurationCounts {
  label: string;
  success?: Rate;
  ok: number;
  failed: number;
  rejected: number;
  not_judged: number;
  best: number;
  details?: { detail: string; count: number }[];
}

interface Spread {
  of: string;
  metric: string;
  count: number;
  mean: number | null;
  quantiles: Quantile[];
}

interface Effects {
  axes: Axis[];
  responses: {
    response: string;
    mean: number | null;
    main: { axis: number; share: number | null; noise: number | null; bins: { mean: number | null }[] }[];
    interactions: { axes: number[]; share: number; noise: number }[];
  }[];
}

interface Regions {
  axes: Axis[];
  maps: { axes: number[]; cells: { layouts: number; working: number; winner: string | null }[] }[];
}

/** The smallest move that was found to break a configuration. */
interface SmallestFound {
  limit: number;
  found: { radius: number; detail: string } | null;
  impossible: number;
  settled: boolean;
}

interface RobustnessResult {
  goal: string;
  configuration: string;
  shift: SmallestFound;
  tilt: SmallestFound;
  unaware: { shift: SmallestFound; tilt: SmallestFound } | null;
}

interface Replanned {
  cases: number;
  of: number;
  gaps: {
    of: string;
    by_postures: number;
    planned: number;
    gained: number;
    gap: number;
    interval: Interval | null;
  }[];
}

interface Evidence {
  invalid?: number[];
  fewer_than?: number[][];
  configurations?: CasesOf[];
}

/** Cases of a configuration that show what goes wrong. */
interface CasesOf {
  of: string;
  not_ok?: number[];
  worst: { metric: string; cases: { case: number; value: number }[] }[];
}
