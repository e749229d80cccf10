// The global `NB`, which scripts of pages share: a script assigns to it, later ones call it. Types of assignments
// come from here, as TypeScript knows a property of another script's object only where it is declared.

/** x, y, z in metres. */
type Point = number[];
/** x, y, z in metres and a quaternion, x, y, z, w. */
type Pose = number[];
/** Red, green, blue, and sometimes opacity, of 1; sRGB. */
type Colour = number[];
/** Red, green, blue of 255. */
type Bytes = number[];

type Numbers = NumberArray | number[];

/** What can be put into an element; false, null and undefined are left out. */
type Child = Node | string | null | undefined | Child[];

type Listener<Name extends keyof HTMLElementEventMap, Tag extends keyof HTMLElementTagNameMap> = (
  event: HTMLElementEventMap[Name] & { target: HTMLElementTagNameMap[Tag] },
) => unknown;

/** Attributes of an element: `on...` are listeners, `text` is its content. */
interface Attributes<Tag extends keyof HTMLElementTagNameMap> {
  [name: string]: unknown;
  text?: string | null;
  class?: string | null;
  onclick?: (event: PointerEvent) => unknown;
  onpointermove?: (event: PointerEvent) => unknown;
  onkeydown?: (event: KeyboardEvent) => unknown;
  /** Of controls, which are their own targets. */
  onchange?: Listener<'change', Tag>;
  oninput?: Listener<'input', Tag>;
}

/** A column of a table. */
interface Column<Row> {
  title: string;
  unit?: string;
  help?: string;
  numeric?: boolean;
  /** Long: may be broken into lines. */
  text?: boolean;
  cell(row: Row): Child | number;
}

/** What plots draw on: the screen or a figure for a paper. */
interface Painter
  extends Pick<
    CanvasRenderingContext2D,
    | 'save'
    | 'restore'
    | 'translate'
    | 'rotate'
    | 'beginPath'
    | 'closePath'
    | 'moveTo'
    | 'lineTo'
    | 'rect'
    | 'arc'
    | 'fill'
    | 'stroke'
    | 'clip'
    | 'fillRect'
    | 'strokeRect'
    | 'fillText'
    | 'measureText'
    | 'setLineDash'
    | 'fillStyle'
    | 'strokeStyle'
    | 'lineWidth'
    | 'textAlign'
    | 'textBaseline'
    | 'font'
  > {
  /** For paper. */
  readonly isPaper?: boolean;
}

type ViewMesh = THREE.Mesh<THREE.BufferGeometry, THREE.MeshLambertMaterial | THREE.MeshBasicMaterial>;

/** A copy of the arm with its tool. */
interface ArmView {
  root?: THREE.Group;
  pose(chain: Chain, joints: ArrayLike<number>): void;
  /** Its base elsewhere. */
  stand(pose: THREE.Matrix4): void;
  /** A colour by frame, or null for the part's own. */
  tint(colorOf: (frame: number) => Colour | null): void;
  show(visible: boolean): void;
  layer(group: string, visible: boolean): void;
}

/** What `save` keeps of a figure for a paper. */
interface PaperState
  extends Pick<Painter, 'fillStyle' | 'strokeStyle' | 'lineWidth' | 'textAlign' | 'textBaseline' | 'font'> {
  dash: number[];
  move: string;
  clip: string;
}

interface SvgContext extends PaperState {}

interface CurvesOptions {
  height: number;
  label: string;
  xTitle: string;
  yTitle: string;
  unit?: string;
  seek(x: number): void;
}

type Paint = (context: Painter, width: number, height: number) => void;

/** A line of a legend: a mark with its words. */
interface Mark {
  text: string;
  draw(context: Painter, x: number, y: number): void;
  color?: undefined;
}

/** A scale of colours in a legend. */
interface Scale {
  text: string;
  low: string;
  high: string;
  color(share: number): string;
}

/** An axis of a plot: its ends, or a place for each label. */
interface AxisRange {
  low: number;
  high: number;
  title: string;
  labels?: string[] | null;
}

interface Box {
  left: number;
  top: number;
  width: number;
  height: number;
}

/** How a line is drawn. */
interface LineStyle {
  color: string;
  dash: number[];
}

/** A curve over one variable. */
interface Curve extends LineStyle {
  name: string;
  x: Numbers;
  y: Numbers;
  width?: number;
}

/** A stretch of a plot. */
interface Band {
  from: number;
  to: number;
  text: string;
  color: string;
}

/** A row of a dot plot: a value with its interval. */
interface Dot {
  label: string;
  value: number | null;
  interval: { low: number; high: number } | null;
  text: string;
  style?: string;
}

/** How near is near, by what is asked. */
interface Nearness {
  key: 'overlap' | 'missed' | 'near' | 'far';
  words: string;
  color: Colour;
  radius: number;
}

/** Choices in a page's address. */
interface AddressChoices {
  [name: string]: string;
}

/** A number as text; of none it is a dash. */
type Shown = (value: number | null | undefined, digits?: number) => string;
type Formats = 'millimetres' | 'length' | 'number' | 'percent' | 'degrees';

/** A file: name, content, type. */
type SavedFile = [name: string, content: string | Blob, type?: string];

/** A label with its control in it. */
type Labelled<Control extends HTMLElement> = HTMLLabelElement & { readonly control: Control };

interface Needlebench {
  // core.js
  /** Milliseconds since the page was opened; for tests. */
  timing: { opened: number; firstView?: number };
  palette: Record<'black' | 'orange' | 'sky' | 'green' | 'yellow' | 'blue' | 'vermillion' | 'purple' | 'grey', string>;
  el<Tag extends keyof HTMLElementTagNameMap>(
    tag: Tag,
    attributes?: Attributes<Tag> | null,
    ...children: Child[]
  ): HTMLElementTagNameMap[Tag];
  present(children: Child[]): (Node | string)[];
  clear(element: Element, ...children: Child[]): Element;
  byId(id: string): HTMLElement;
  ARROWS: { [key: string]: number | undefined };
  tableRows(table: HTMLElement): HTMLTableRowElement[];
  context(canvas: HTMLCanvasElement, options?: CanvasRenderingContext2DSettings): CanvasRenderingContext2D;
  folds(kind: string): NodeListOf<HTMLDetailsElement>;
  inflate(id: string): Promise<ArrayBuffer>;
  read(): Promise<PageDocument>;
  // The caller knows whose document it is.
  // biome-ignore lint/suspicious/noExplicitAny: read from outside
  unpack(raw: ArrayBuffer): any;
  load(id: string): Promise<void>;
  /** The arrays of the payload, and where they begin in it. */
  raw: ArrayBuffer;
  arrays: number;
  array(reference: Packed): NumberArray;
  // The page's script knows which document it is.
  // biome-ignore lint/suspicious/noExplicitAny: read from outside
  start(build: (page: any, app: HTMLElement) => void): Promise<void>;
  /** The page; for tests, each of which knows which one it has opened. */
  get current(): RunPage & AtlasPage & SearchPage & StudyPage;
  set current(page: RunPage | AtlasPage | SearchPage | StudyPage);
  metricColumns<Row extends { metrics: { [key: string]: number } }>(columns: MetricColumn[]): Column<Row>[];
  words(name: string | null | undefined): string;
  dictionary: Map<string, string>;
  regionWords: { [name: string]: string };
  address: {
    read(): AddressChoices;
    write(choices: { [name: string]: string | number | null | undefined }): void;
    watch(apply: (choices: AddressChoices) => void): void;
    pending: { [name: string]: string | number | null | undefined };
    timer?: ReturnType<typeof setTimeout>;
    written?: string;
  };
  copyLink(): HTMLButtonElement;
  table<Row>(
    caption: string,
    columns: Column<Row>[],
    rows: readonly Row[],
    options?: { class?: string; row?: (row: Row) => Attributes<'tr'> },
  ): HTMLElement;
  scroll(label: string, content: HTMLElement): HTMLElement;
  hint(box: HTMLElement): void;
  section(title: string, open: boolean, ...children: Child[]): HTMLDetailsElement;
  verdict(verdict: string): HTMLElement;
  checkbox(label: string, checked: boolean, change: (checked: boolean) => void): Labelled<HTMLInputElement>;
  select(
    label: string,
    options: [key: string, text: string][],
    value: string,
    change: (value: string) => void,
  ): Labelled<HTMLSelectElement>;
  rows(rows: HTMLElement[], choose: (index: number) => void): void;
  mark(rows: HTMLElement[], chosen: number): void;
  tree(value: unknown): HTMLElement;
  provenance(provenance: Provenance, file?: string): HTMLElement;

  // number.js
  /** Texts as number.rs writes them; for the test. */
  plain: {
    smallLength(metres: number): string;
    valueAndLimit(value: number, limit: number, unit: string): string[];
    percent(share: number): string;
    shown: Record<Formats, (value: number) => string>;
    threeDigits(value: number): string;
    measured(value: number, unit: string): string;
  };
  minus(text: string): string;
  fixed(value: number | null | undefined, digits: number): string;
  mm: Shown;
  deg: Shown;
  percent(share: number | null | undefined): string;
  share(share: number | null | undefined): string;
  threeDigits(value: number | null | undefined): string;
  measured(value: number | null | undefined, unit: string): string;
  length(metres: number | null | undefined): string;
  formats: Record<Formats, (value: number | null | undefined) => string>;
  valueAndLimit(value: number | null | undefined, limit: number | null | undefined, unit: string): string[];
  quantity(value: number | null | undefined, unit: string): string;
  significant(value: number | null | undefined): string;

  // view.js
  CREASE_COSINE: number;
  BASE: number;
  matrix(pose: ArrayLike<number>): THREE.Matrix4;
  aboutBase(base: Pose, reach: number): Point[];
  forward(chain: Chain, joints: ArrayLike<number>): THREE.Matrix4[];
  geometry(surface: Surface): THREE.BufferGeometry;
  hasWebgl(): boolean;
  direction(base: Pose, target: Point, axis: Point): Point;
  cone(halfAngle: number, length: number): THREE.BufferGeometry;

  // plot.js
  ticks(low: number, high: number, count: number): { at: number[]; step: number };
  tickText(value: number, step: number): string;
  classStyle: { [name: string]: LineStyle };
  styleOf(name: string): LineStyle;
  sample(style: LineStyle): SVGElement;
  at(x: ArrayLike<number>, y: ArrayLike<number>, at: number): number;

  // svg.js
  /** Width in mm and in pixels, and size of letters in pixels. */
  COLUMN: { mm: number; px: number; font: number };
  short(value: number): string;
  xml(text: unknown): string;
  save(...file: SavedFile): void;
  fileName(...words: (string | null | undefined)[]): string;
  saveButton(text: string, title: string, file: () => SavedFile | Promise<SavedFile>): HTMLButtonElement;
  paper(title: string, paint: Paint, height: number, legend?: Mark[]): string;
  chart(title: string, svg: string, name: string, help?: string): HTMLElement;
  pngButton(view: View, title: string, name: string | (() => string)): HTMLElement | string;

  // run_sections.js
  ghostColors: string[];
  swatch(color: string): HTMLElement;
  listed(texts: (string | null | undefined | false)[]): string;
  criterionWords(name: string): string;
  byClass(clearances: Clearances): [name: string, found: ClassMinimum][];
  around(page: RunDocument, clearances: Clearances): [name: string, found: ClassMinimum][];
  leastAround(page: RunDocument, clearances: Clearances): Nearest | null;
  certifiedAround(page: RunDocument, clearances: Clearances): number | null;
  clearanceColumns(page: RunDocument): Column<{ measured: { clearance: Clearances } }>[];
  sections: RunSections;

  // run.js
  longest(covariance: number[][]): number;
  cholesky(covariance: number[][]): number[][];

  // explore.js
  NEARNESS: Nearness[];
  nearness(distance: number, limit: number | null): Nearness;
  JOINTS: string[];

  // atlas.js
  /** A colour and which hatching. */
  ruleStyle(colors: { [rule: string]: string }, name: string): RuleStyle;
  aims: { [name: string]: string };

  // statistics.js, study.js and those beside them
  ROUNDING_MM: number;
  MOST_CHOICES: number;
  MOST_MARKS: number;
  FEW_CASES: number;
  trend(values: (number | null)[]): HTMLElement;
  folded(item: Mark): Mark[];
  dotRow(width: number): number;
  dotHeight(rows: number): (width: number) => number;
  dotPlot(context: Painter, width: number, height: number, rows: Dot[], x: AxisRange): void;
  configurationStyles: LineStyle[];
  viridis(share: number): Bytes;
  grouped(value: number): string;
  jitter(index: number, salt: number): number;
  rgb(color: Bytes): string;
  isRounding(metric: { unit: string; values: Numbers }): boolean;
}

type RuleStyle = [color: string, hatch: number];

/** Sections of the page of a run. */
interface RunSections {
  answer(goal: GoalReport, criteria: CriterionResult[], trueTarget: string | null, isJudged: boolean): Child;
  route(goal: GoalReport, criteria: CriterionResult[]): Child;
  goals(run: RunPage, choose: (index: number) => void): { element: HTMLElement; rows: HTMLElement[] } | null;
  margins(c: ConfigurationReport): Child;
  budget(goal: GoalReport, configuration: ConfigurationReport, charts: ConfigurationCharts | null, name: string): Child;
  people(goal: GoalReport): Child;
  probability(goal: GoalReport, configuration: ConfigurationReport): Child;
  criteria(page: RunDocument): HTMLElement;
  summary(criteria: CriterionResult[]): HTMLElement;
  requirements(report: Report): HTMLElement | null;
  provenance(report: Report): HTMLElement;
  events(
    page: RunDocument,
    goal: GoalReport,
    configuration: ConfigurationReport,
    charts: ConfigurationCharts | null,
  ): Child;
  press(
    configurations: WithEvents[],
    configuration: ConfigurationReport,
    charts: ConfigurationCharts | null,
    goal: GoalReport,
    name: string,
  ): Child[];
  stop(page: RunDocument, configurations: WithEvents[]): Child[];
  retract(page: RunDocument, configurations: WithEvents[]): Child[];
}

type WithEvents = ConfigurationReport & { events: Events };
type WithRoom = ConfigurationReport & { room: RoomReport };

/** Rows of the tables of events. */
interface PressRow {
  c: WithEvents;
  press: Press;
  index: number;
  engine: string;
  measured: PressMeasured | null;
}
interface StopRow {
  c: WithEvents;
  stop: Stop;
  engine: string;
  measured: StopMeasured;
}
interface RetractRow {
  c: WithEvents;
  engine: string;
  measured: Retract;
}

/** What a candidate of a search turned out to be. */
type CandidateKind = 'best' | 'equal' | 'certain' | 'maybe' | 'other';

interface FigureOptions {
  name: string;
  title: string;
  help?: string;
  label?: string;
  /** Of a width, or the same for all. */
  height: number | ((width: number) => number);
  paint: Paint;
  legend?(): (Mark | Scale)[];
}

/** What a study's page keeps of its document. */
interface ShownFactor extends StudyFactor {
  values: NumberArray;
}
interface ShownMetric extends StudyMetric {
  values: NumberArray;
}

/** What the plots show. */
interface StudyState {
  /** Factors. */
  x: number;
  y: number;
  color: string;
  /** -1 for the best of each layout. */
  configuration: number;
  metric: string | undefined;
  /** Level by factor. */
  filters: Map<number, number>;
}

interface StudyAxis extends AxisRange {
  labels: string[] | null;
  bins: number;
  salt: number;
}

/** A kind of cases: its name, its colour, its shape, its words. */
type CaseKind = [name: string, color: Bytes, shape: string, words: string];

/** Colours of cases: by kind, or by a number. */
type Coloring =
  | { kinds: CaseKind[]; of(index: number): number }
  | {
      kinds?: undefined;
      low: number;
      high: number;
      scale: { low: string; high: string; text: string };
      value(index: number): number;
    };

/** Places of cases over two factors. */
interface Places {
  /** Place of each case that is shown. */
  of: Uint32Array;
  /** First case of each place. */
  first: number[];
  counts: Uint32Array;
  most: number;
  x: number[];
  y: number[];
  grid: boolean;
}

/** Colours of places: with how many cases of each kind, or with a median. */
interface PlaceMarks {
  color(place: number): Bytes;
  counts: Uint32Array;
  totals: Uint32Array;
  middle: number[];
}

/** What the plots of a study draw from. */
interface StudyPlots {
  page: StudyDocument;
  summary: StudySummary;
  metrics: ShownMetric[];
  exact: ShownMetric[];
  numbers: NumberArray | null;
  posed: Map<number, number>;
  poses: NumberArray;
  state: StudyState;
  count: number;
  factors: ShownFactor[];
  axesOf: StudyAxis[];
  indices: Uint32Array;
  outcomes: NumberArray;
  outcomeOf: string[];
  best: Int8Array;
  working: Uint8Array;
  invalid: Uint8Array;
  chosen: number | undefined;
  placed: Places | null;
  sorted: Float32Array[] | null;
  scatterAxes?: Axes;
  ecdfAxes?: Axes;
  mapCells?: { axes: Axes; nx: number; ny: number; ok: Uint32Array; of: Uint32Array };
  scatterItems?: (Mark | Scale)[];
  mapItems?: (Mark | Scale)[];
  ecdfItems?: (Mark | Scale)[];
  outcome(index: number): string;
  row(index: number): number;
  bin(axis: StudyAxis, factor: ShownFactor, index: number): number;
  metric(name: string | undefined): ShownMetric | undefined;
  titleOf(metric: { words: string; unit: string }): string;
}
