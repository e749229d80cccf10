// The global `PLAN` of the planning page, and what its server answers: `server.rs` and those beside it.

/** Columns, rows, slices: an index means a voxel's centre. */
type Index = number[];

/** Where a needle is to end or comes from. */
interface PlaceAim {
  lesion?: string;
  place_m?: Point;
  index?: Index;
}

interface NeedleAim {
  goal?: string | null;
  target: PlaceAim;
  entry: PlaceAim;
}

/** A needle, as far as it is chosen. */
interface NeedleChoice {
  goal?: string | null;
  target?: PlaceAim | null;
  entry?: PlaceAim | null;
  configuration?: string | null;
}

interface KeptRoute {
  name: string;
  needle: NeedleChoice;
}

/** What a person decided. */
interface PlanState {
  notes: string;
  window_hu: number[];
  crosshair: Index;
  hidden_markers: string[];
  needle: NeedleChoice;
  routes: KeptRoute[];
}

/** What undo brings back. */
type Undoable = Pick<PlanState, 'needle' | 'hidden_markers' | 'routes'>;

/** What a session has of it: null where nothing was decided. */
type KeptState = { [Key in keyof PlanState]: PlanState[Key] | null };

interface Session extends KeptState {
  schema_version: number;
  version: number;
}

/** What cannot be done, and what to do about it. */
interface Refusal {
  message: string;
  hint: string | null;
}

interface Lesion {
  name: string;
  center_m: Point;
  index: Index;
  diameter_m: number | null;
  registration_rms_m: number | null;
}

interface Marker {
  name: string;
  center_m: Point;
  index: Index;
  diameter_m: number;
  residual_m: number;
  expected_residual_m: number;
  by_the_others_m: number | null;
}

/** What the page has to know of a case at its start. */
interface CaseFacts {
  name: string;
  size: number[];
  spacing_m: number[];
  first_voxel_m: Point;
  phantom_origin_m: Point;
  world_from_phantom: Pose | null;
  needle_diameter_m: number;
  lesions: Lesion[];
  labels: { label: number; name: string }[];
  markers: Marker[];
  registration: { fre_rms_m: number; expected_fre_rms_m: number | null; suspects: string[] } | null;
  robot_is_unknown: string | null;
  goals: { name: string; lesion: string | null; target_m: Point | null; entry_m: Point | null }[];
  plan_file: string;
  route_colours: {
    /** By rule: its words and its colour. */
    rules: { [rule: string]: [words: string, color: Bytes] | undefined };
    /** Of the least odds, and of twice the least and more. */
    free: Bytes[];
  };
}

/** The cell in three dimensions. */
interface PlanDocument extends PageDocument {
  scene: Scene;
  start: number[];
}

interface PlaceAnswer {
  ct_mm: Point;
  hu: number | null;
  label: string | null;
}

interface RouteAnswer {
  entry_m: Point;
  entry_index: Index;
  target_m: Point;
  target_index: Index;
  entry_moved_m: number;
  length_m: number;
  /** How tissue bends the median needle: depths and how far it is off the straight line, m. */
  bend: {
    path_m: [number, number][];
    tip_m: number;
    is_aimed: boolean;
    towards: Point | null;
    is_force_measured: boolean;
  } | null;
  insertion_m: number | null;
  not_placed: Refusal | null;
  needle_m: number;
  skin_angle_rad: number;
  axial_angle_rad: number;
  crossings: { name: string; from_m: number; to_m: number }[];
  crossing_within_m: number;
  in_lung_m: number | null;
  lung_entries: number | null;
  tissues: {
    tissue: string;
    words: string;
    distance_m: number;
    margin_m: number;
    kept: boolean;
    is_bent: boolean;
    surface_p99_m: number | null;
  }[];
  fissures: string[];
  judged: Judged | null;
  /** Why no run allows it. */
  refusal: string | null;
}

/** A needle by the rules of routes. */
interface Judged {
  free: boolean;
  broken: string | null;
  bent?: string;
  value: number | null;
  limit: number | null;
  is_least: boolean;
  unit: string | null;
  odds_ratio: number | null;
  unknown: string[];
}

interface ReachAnswer {
  quick: boolean;
  preview: {
    working: number;
    configurations: {
      label: string;
      works: boolean;
      joints_rad: number[] | null;
      nearest: { distance_m: number; pair: string[] } | null;
    }[];
  } | null;
  reasons: string[];
}

/** Moments of the tip along the axes of the scan. */
interface TipError {
  bias_m: number[];
  covariance_m2: number[][];
  rms_m: number;
  lateral_rms_m: number;
}

interface MotionAnswer {
  configuration: string;
  rejections: { words: string; detail: string }[];
  time_s: number[];
  joints_rad: number[][];
  end_joints_rad: number[] | null;
  tip: TipError | null;
  tip_unknown: string | null;
}

interface PeopleAnswer {
  room: RoomReport;
  view: { people: Person[]; sight: number[]; guideEntry: Pose };
}

interface EntriesAnswer {
  plan: RoutePlan;
  remarks: { message: string }[];
}

interface RoutePlan {
  target_in_phantom_m: Point;
  phantom_origin_in_ct_m: Point;
  margins: { obstacle: string; known: boolean }[];
  tried: number;
  free: number;
  refused: { rule: string; count: number }[];
  wanted: number;
  routes: PlannedRoute[];
  chosen: { route: number } | null;
  map: RouteMap;
}

/** Directions from the target, column by column: which rule forbids each, how deep the skin is. */
interface RouteMap {
  azimuth_deg: number[];
  elevation_deg: number[];
  depth_m: (number | null)[];
  odds_ratio: (number | null)[];
  rules: string[];
  rule: (number | null)[];
  value: (number | null)[];
  limit: (number | null)[];
}

interface PlannedRoute {
  direction_deg: number[];
  depth_m: number;
  /** For tests. */
  depth_in_lung_m: number;
  pleural_crossings: number;
  margins: { obstacle: string; part: string | null; distance_m: number | null }[];
  /** Of the needle as tissue bends it, where one is known. */
  bend?: {
    tip_m: number;
    towards_in_phantom: number[] | null;
    margins: PlannedRoute['margins'];
  };
  risk: { odds_ratio: number };
  working: number;
  best: string | null;
  configurations: {
    label: string;
    works: boolean;
    clearance_m: number | null;
    free_fraction: number | null;
    error: { target_lateral_rms_m: number } | null;
  }[];
}

interface SimulationProgress {
  state: 'none' | 'running' | 'finished' | 'failed' | 'cancelled';
  plan: string | null;
  left_out: string[];
  message: string;
  has_report: boolean;
}

/** What the body of an answer without success says. */
interface ProblemBody {
  error?: string;
  hint?: string;
  /** What another tab has kept. */
  session?: Session;
  /** What has to be agreed to before a plan is written. */
  ask?: 'refused' | 'overwrite';
  file?: string;
  free?: string;
}

/** An answer that may be that there is none: refused, or not to be had at all. */
type Answered<Answer> =
  | (Answer & { refused?: undefined; problem?: undefined })
  | { refused: Refusal; problem?: undefined }
  | { refused: Refusal; problem: Problem };

/** A question, and what it is answered with. */
interface Questions {
  place: [question: { index: Index }, answer: PlaceAnswer];
  route: [question: { aim: NeedleAim }, answer: RouteAnswer];
  reach: [question: { aim: NeedleAim; quick?: boolean }, answer: ReachAnswer];
  motion: [question: { aim: NeedleAim; configuration: string }, answer: MotionAnswer];
  people: [question: { aim: NeedleAim | null; joints_rad: number[] }, answer: PeopleAnswer];
  entries: [question: { aim: { goal?: string | null; target: PlaceAim }; robot: boolean }, answer: EntriesAnswer];
}

type WhenAnswered<Kind extends keyof Questions> = (
  answer: Answered<Questions[Kind][1]>,
  question: Questions[Kind][0],
  tookInMs: number,
) => void;

interface AskOptions {
  method?: string;
  body?: object;
}

/** A plane along the patient's axes: to the right, down, through; `flip` where down is backwards. */
interface Plane {
  title: string;
  u: number;
  v: number;
  w: number;
  flip: boolean;
  letters: string[];
}

/** A column of a table of routes. */
interface RouteColumn {
  name: string;
  route: RouteAnswer | null;
  reach?: ReachAnswer | null;
}

interface Planning {
  // api.js
  token: string;
  page: string;
  fetch(path: string, options?: AskOptions): Promise<Response>;
  // The caller knows what it has asked for.
  // biome-ignore lint/suspicious/noExplicitAny: read from outside
  ask(path: string, options?: AskOptions): Promise<any>;
  question(at: HTMLElement, text: string, answers: string[]): Promise<number>;
  // biome-ignore lint/suspicious/noExplicitAny: read from outside
  write(path: string, plan: { aim: NeedleAim | null; engine?: string }, at: HTMLElement): Promise<any>;
  agreed?: string;
  rgb(channels: Bytes): string;
  swatch(color: string, words: string): HTMLElement;

  // volume.js
  bytes(path: string, count: number, progress: (share: number) => void): Promise<Uint8Array<ArrayBuffer>>;
  greys(window: number[]): Uint32Array;
  paint(
    size: number[],
    plane: Plane,
    slice: number,
    canvas: HTMLCanvasElement,
    pixel: (at: number, column: number, line: number) => number,
  ): void;
  plane(volume: Volume, plane: Plane, slice: number, greys: Uint32Array, canvas: HTMLCanvasElement): void;
  outlines(
    size: number[],
    labels: Uint16Array,
    plane: Plane,
    slice: number,
    colors: Map<number, number>,
    canvas: HTMLCanvasElement,
  ): void;
  add(a: number[], b: number[], by?: number): number[];
  dot(a: number[], b: number[]): number;
  cross(a: number[], b: number[]): number[];
  unit(a: number[]): number[];

  // slices.js
  PLANES: { [name: string]: Plane };
  COLORS: Record<'needle' | 'target' | 'entry' | 'cross' | 'lesion' | 'marker' | 'error' | 'bent', string>;
  SIGMAS_95: number;
  towards(direction: number[]): string;
  /** Lines of the median needle as tissue bends it, mm of ct. */
  bends(route: RouteAnswer, entry: number[], along: number[], aside: number[]): number[][][];

  // room.js, routes.js, simulation.js
  posture(motion: { time_s: number[]; joints_rad: number[][] }, time: number): number[];
  routeRows(columns: RouteColumn[], caption: string): HTMLElement;
  withoutGoals(leftOut: string[]): string;

  // planner.js
  WINDOWS: { [name: string]: number[] };
  WINDOW_NAMES: { [name: string]: string };
  taken(session: Session): KeptState;
  open(): Promise<void>;
  planner: Planner;
}
