//! The server: on this machine alone, for requests with its token.

use std::fs::{File, TryLockError};
use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::rejection::BytesRejection;
use axum::extract::{DefaultBodyLimit, Path as UrlPath, Request, State};
use axum::http::{HeaderMap, Method, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use nalgebra::Point3;
use needlebench_parallel::{Control, Silent};
use needlebench_report::chart::routes::route_colours;
use needlebench_report::page::shared;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use tokio::sync::Notify;

use crate::answer::{Problem, json_response};
use crate::case::Case;
use crate::entries;
use crate::guard::{COOKIE, Hosts, Token, check_cookie, check_token};
use crate::listen::serve;
use crate::live::{self, Aim, GoalAim, Refusal};
use crate::motion;
use crate::page;
use crate::people;
use crate::plan_file::{Consent, NotWritten, PLAN_FILE, Written, write_plan};
use crate::session::{NotKept, SessionFile, State as SessionState};
use crate::simulation::{Engine, Simulation};
use crate::turns::Turns;

/// Most bytes that a question may have: notes are the longest of it.
const MOST_BODY: usize = 256 * 1024;

/// Why there is no server.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// The port is taken, or may not be used.
    #[error("port {port} of 127.0.0.1 cannot be used: {error}")]
    Port {
        /// The port; 0 for any.
        port: u16,
        /// What the system says.
        error: io::Error,
    },
    /// Another server writes the session.
    #[error("another `needlebench view` shows this folder")]
    Shown,
    /// Something else has the name of the lock.
    #[error("session.lock in this folder is not a regular file")]
    LockIsNoFile,
    /// No random numbers for a token.
    #[error("no random numbers available on this machine: {0}")]
    Random(#[from] getrandom::Error),
    /// No threads.
    #[error("the server cannot start: {0}")]
    Runtime(io::Error),
}

impl ServerError {
    /// What to do about it.
    pub fn hint(&self) -> Option<&'static str> {
        match self {
            Self::Port { .. } => Some("omit --port to use any free port"),
            Self::Shown => Some("open the address that it printed, or stop it first"),
            Self::LockIsNoFile => {
                Some("remove the link or folder session.lock; it is created again")
            }
            Self::Random(_) | Self::Runtime(_) => None,
        }
    }
}

/// Held while a folder is shown; the system lets go of it however the program ends.
const LOCK_FILE: &str = "session.lock";

/// None where locks or files are not available: the session reports an error when it cannot be saved.
fn locked(folder: &Path) -> Result<Option<File>, ServerError> {
    let path = folder.join(LOCK_FILE);
    // A link would be followed, and its target must not be opened here.
    if path.symlink_metadata().is_ok_and(|about| !about.is_file()) {
        return Err(ServerError::LockIsNoFile);
    }
    let mut options = File::options();
    options.read(true).write(true).create(true).truncate(false);
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt;
        // One that has come since is not followed either.
        options.custom_flags(rustix::fs::OFlags::NOFOLLOW.bits().cast_signed());
    }
    let Ok(file) = options.open(path) else {
        return Ok(None);
    };
    match file.try_lock() {
        Ok(()) => Ok(Some(file)),
        Err(TryLockError::WouldBlock) => Err(ServerError::Shown),
        Err(TryLockError::Error(_)) => Ok(None),
    }
}

/// A server that listens, and answers once it runs.
pub struct Server {
    _lock: Option<File>,
    runtime: tokio::runtime::Runtime,
    listener: tokio::net::TcpListener,
    address: SocketAddr,
    app: Arc<App>,
    stopped: Arc<Notify>,
}

/// Ends a server, from any thread.
#[derive(Debug, Clone)]
pub struct Stopper(Arc<Notify>);

impl Stopper {
    /// Now, or as soon as it runs.
    pub fn stop(&self) {
        self.0.notify_one();
    }
}

struct App {
    case: Arc<Case>,
    scene: Bytes,
    session: SessionFile,
    /// One writer at a time.
    writing: tokio::sync::Mutex<()>,
    simulation: Simulation,
    hosts: Hosts,
    token: Token,
    results: Token,
    threads: usize,
    quick: Turns,
    /// Of the robot during a drag: beside the needle's own numbers, never before them.
    quick_reach: Turns,
    exact: Turns,
}

impl Server {
    /// Listens on 127.0.0.1, at any free port if it is 0. `program` simulates plans.
    ///
    /// # Errors
    /// What keeps it from listening; another server that shows the folder.
    pub fn new(case: Case, port: u16, program: PathBuf) -> Result<Self, ServerError> {
        let lock = locked(case.folder())?;
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .enable_all()
            .build()
            .map_err(ServerError::Runtime)?;
        let taken = |error| ServerError::Port { port, error };
        let bound = tokio::net::TcpListener::bind((Ipv4Addr::LOCALHOST, port));
        let listener = runtime.block_on(bound).map_err(taken)?;
        let address = listener.local_addr().map_err(taken)?;
        let app = App {
            scene: shared::scene(case.desk().scenario()).into(),
            session: SessionFile::new(case.folder(), case.built().sha256()),
            writing: tokio::sync::Mutex::new(()),
            simulation: Simulation::new(program, case.folder()),
            hosts: Hosts::new(address.port()),
            token: Token::new()?,
            results: Token::new()?,
            threads,
            quick: Turns::new(threads),
            quick_reach: Turns::new(1),
            exact: Turns::new(threads),
            case: Arc::new(case),
        };
        Ok(Self {
            _lock: lock,
            runtime,
            listener,
            address,
            app: Arc::new(app),
            stopped: Arc::default(),
        })
    }

    /// The address to open. The token stands behind `#`: browsers keep that to themselves.
    pub fn url(&self) -> String {
        format!("http://{}/#{}", self.address, self.app.token.text())
    }

    /// The port.
    pub fn port(&self) -> u16 {
        self.address.port()
    }

    /// What ends it.
    pub fn stopper(&self) -> Stopper {
        Stopper(Arc::clone(&self.stopped))
    }

    /// Answers until it is stopped.
    pub fn run(self) {
        let router = router(Arc::clone(&self.app));
        self.runtime.block_on(async {
            // Pages hold connections open that would be waited for otherwise.
            tokio::select! {
                () = serve(self.listener, router) => {}
                () = self.stopped.notified() => {}
            }
        });
        self.app.simulation.cancel();
        self.runtime.shutdown_background();
    }
}

type Shared = State<Arc<App>>;
type Answer = Result<Response, Problem>;

fn router(app: Arc<App>) -> Router {
    let api = Router::new()
        .route("/case", get(case))
        .route("/volume", get(volume))
        .route("/labels", get(labels))
        .route("/scene", get(scene))
        .route("/place", post(place))
        .route("/route", post(route))
        .route("/reach", post(reach))
        .route("/entries", post(planned_entries))
        .route("/motion", post(planned_motion))
        .route("/people", post(people_at))
        .route("/session", get(session).put(keep_session))
        .route("/plan", post(plan))
        .route("/simulation", get(simulated).post(simulate).delete(cancel))
        .fallback(nothing_here)
        .layer(middleware::from_fn_with_state(Arc::clone(&app), with_token));
    Router::new()
        .route("/", get(index))
        .route("/assets/{name}", get(asset))
        .route("/results/report.html", get(report))
        .nest("/api", api)
        .fallback(nothing_here)
        .layer(DefaultBodyLimit::max(MOST_BODY))
        .layer(middleware::from_fn_with_state(Arc::clone(&app), with_host))
        .with_state(app)
}

async fn with_host(State(app): Shared, request: Request, next: Next) -> Response {
    let answer = match app.hosts.check(request.headers()) {
        Ok(()) => next.run(request).await,
        Err(problem) => problem.into_response(),
    };
    let answer = if answer.status() == StatusCode::METHOD_NOT_ALLOWED {
        let problem = Problem::new(
            StatusCode::METHOD_NOT_ALLOWED,
            "method not allowed for this address",
        );
        let allow = answer.headers().get(header::ALLOW).cloned();
        let mut said = problem.into_response();
        if let Some(allow) = allow {
            said.headers_mut().insert(header::ALLOW, allow);
        }
        said
    } else {
        answer
    };
    page::guarded(answer)
}

async fn with_token(State(app): Shared, request: Request, next: Next) -> Response {
    match check_token(request.headers(), &app.token) {
        Ok(()) => next.run(request).await,
        Err(problem) => problem.into_response(),
    }
}

async fn nothing_here() -> Problem {
    Problem::new(StatusCode::NOT_FOUND, "not found")
}

async fn index() -> Answer {
    asset(UrlPath("index.html".to_owned())).await
}

async fn asset(UrlPath(name): UrlPath<String>) -> Answer {
    match page::file(&name) {
        Some(file) => Ok(file),
        None => Err(nothing_here().await),
    }
}

/// The body of a request, parsed.
fn read<T: DeserializeOwned>(body: Result<Bytes, BytesRejection>) -> Result<T, Problem> {
    let body = body.map_err(|rejection| {
        if rejection.status() == StatusCode::PAYLOAD_TOO_LARGE {
            Problem::new(
                StatusCode::PAYLOAD_TOO_LARGE,
                format!("a request is limited to {} KiB", MOST_BODY / 1024),
            )
        } else {
            Problem::new(StatusCode::BAD_REQUEST, "the request is incomplete")
        }
    })?;
    serde_json::from_slice(&body)
        .map_err(|error| Problem::new(StatusCode::BAD_REQUEST, format!("invalid request: {error}")))
}

async fn case(State(app): Shared) -> Response {
    json_response(&description(&app.case))
}

/// What the page needs to know of a case at its start.
fn description(case: &Case) -> Value {
    let grid = case.grid();
    let facts = case.built().facts();
    let index =
        |place: [f64; 3]| -> [f64; 3] { grid.index_from_ct(&Point3::from(place)).coords.into() };
    let lesions = facts.targets.iter().map(|target| {
        let known = facts
            .lesions
            .iter()
            .find(|lesion| lesion.name == target.name);
        let size = known.and_then(|lesion| lesion.size.as_ref());
        json!({
            "name": target.name,
            "center_m": target.center_m,
            "index": index(target.center_m),
            "covariance_m2": target.covariance_m2,
            "diameter_m": size.map(|size| size.equivalent_diameter_m),
            "registration_rms_m": target.registration.as_ref().map(|it| it.rms_m),
        })
    });
    let found = facts
        .markers
        .as_ref()
        .map(|markers| &markers.found[..])
        .unwrap_or_default();
    let registered = facts.registration.as_ref();
    let markers = registered
        .into_iter()
        .flat_map(|it| &it.markers)
        .filter_map(|marker| {
            let place = found.get(marker.detected)?;
            Some(json!({
                "name": marker.name,
                "center_m": place.center_m,
                "index": index(place.center_m),
                "diameter_m": place.diameter_m,
                "residual_m": marker.residual_m.norm(),
                "expected_residual_m": marker.expected_residual_m,
                "by_the_others_m": marker.leave_one_out.as_ref().map(|left| left.error_m.norm()),
            }))
        });
    let resolved = case.desk().scenario();
    let world_from_phantom = resolved
        .phantom
        .as_ref()
        .map(|placed| placed.world_from_phantom);
    let pose = world_from_phantom.map(|pose| {
        let (t, q) = (pose.translation.vector, pose.rotation);
        [t.x, t.y, t.z, q.i, q.j, q.k, q.w]
    });
    json!({
        "schema_version": 1,
        "name": resolved.scenario.name,
        "size": grid.size(),
        "spacing_m": grid.spacing_m(),
        "first_voxel_m": [grid.first_m().x, grid.first_m().y, grid.first_m().z],
        "phantom_origin_m": case.in_ct(&Point3::origin()).coords.as_slice(),
        "world_from_phantom": pose,
        "needle_diameter_m": resolved.cell.tool.needle.outer_diameter_m,
        "lesions": lesions.collect::<Vec<_>>(),
        "labels": case.labels().names.iter().map(|(label, name)| json!({"label": label, "name": name})).collect::<Vec<_>>(),
        "markers": markers.collect::<Vec<_>>(),
        "registration": registered.map(|it| json!({
            "fre_rms_m": it.fre_rms_m,
            "expected_fre_rms_m": it.expected_fre_rms_m,
            "suspects": it.suspects,
        })),
        "robot_is_unknown": case.built().not_registered(),
        "goals": case.goals().iter().map(|goal| json!({
            "name": goal.name,
            "lesion": goal.lesion,
            "target_m": goal.target_mm.map(|mm| ct_from_mm(case, mm)),
            "entry_m": goal.entry_mm.map(|mm| ct_from_mm(case, mm)),
        })).collect::<Vec<_>>(),
        "plan_file": PLAN_FILE,
        "route_colours": route_colours(),
    })
}

fn ct_from_mm(case: &Case, mm: [f64; 3]) -> [f64; 3] {
    case.in_ct(&Point3::from(mm.map(|number| number * 1e-3)))
        .coords
        .into()
}

/// Values as two bytes each, little endian, slice after slice: nothing is in memory twice.
fn voxels<T: Copy + Send + Sync + 'static>(
    case: &Arc<Case>,
    values: for<'c> fn(&'c Case) -> &'c [T],
    bytes: fn(T) -> [u8; 2],
) -> Response {
    let [columns, rows, slices] = case.grid().size();
    let per_slice = columns * rows;
    let all = Arc::clone(case);
    let blocks = (0..slices).map(move |k| {
        let slice = &values(&all)[k * per_slice..(k + 1) * per_slice];
        let block: Vec<u8> = slice.iter().flat_map(|value| bytes(*value)).collect();
        Ok::<_, io::Error>(Bytes::from(block))
    });
    let headers = [
        (header::CONTENT_TYPE, "application/octet-stream".to_owned()),
        (header::CONTENT_LENGTH, (2 * per_slice * slices).to_string()),
    ];
    (
        headers,
        Body::from_stream(crate::turns::Blocks::new(blocks)),
    )
        .into_response()
}

async fn volume(State(app): Shared) -> Response {
    voxels(&app.case, Case::hu, i16::to_le_bytes)
}

async fn labels(State(app): Shared) -> Response {
    voxels(&app.case, |case| &case.labels().labels, u16::to_le_bytes)
}

async fn scene(State(app): Shared) -> Response {
    let headers = [(header::CONTENT_TYPE, "application/octet-stream")];
    (headers, app.scene.clone()).into_response()
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlaceQuestion {
    index: [f64; 3],
    /// As of other questions; this one is answered at once.
    #[serde(default, rename = "page")]
    _page: Option<String>,
    #[serde(default, rename = "turn")]
    _turn: Option<u64>,
}

async fn place(State(app): Shared, body: Result<Bytes, BytesRejection>) -> Answer {
    let PlaceQuestion { index, .. } = read(body)?;
    if index
        .iter()
        .any(|number| number.is_nan() || number.abs() >= 1e6)
    {
        return Err(Problem::new(
            StatusCode::BAD_REQUEST,
            "an index needs three finite numbers",
        ));
    }
    let place = app.case.place(&Point3::from(index));
    Ok(json_response(&json!({
        "ct_m": place.ct_m.coords.as_slice(),
        "ct_mm": (place.ct_m.coords * 1e3).as_slice(),
        "hu": place.hu,
        "label": place.label,
    })))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Question {
    aim: Aim,
    /// Which page sends it, and the number of its requests.
    #[serde(default)]
    page: Option<String>,
    #[serde(default)]
    turn: Option<u64>,
    #[serde(default)]
    configuration: Option<String>,
    /// Of reach: an answer at once, from few roll angles.
    #[serde(default)]
    quick: bool,
}

impl Question {
    fn turn(&self, kind: &str) -> Option<(String, u64)> {
        turn_of(kind, self.page.as_ref(), self.turn)
    }
}

/// Whose turn of a kind of question it is.
fn turn_of(kind: &str, page: Option<&String>, turn: Option<u64>) -> Option<(String, u64)> {
    let page: String = page?.chars().take(32).collect();
    Some((format!("{kind} {page}"), turn?))
}

/// An invalid needle is an answer, too.
fn answered<T: Serialize>(found: &Result<T, Refusal>) -> Response {
    match found {
        Ok(found) => json_response(found),
        Err(refusal) => json_response(&json!({"refused": refusal})),
    }
}

async fn route(State(app): Shared, body: Result<Bytes, BytesRejection>) -> Answer {
    let question: Question = read(body)?;
    let case = Arc::clone(&app.case);
    let turn = question.turn("route");
    let found = app
        .quick
        .run(turn, move || live::route(&case, &question.aim))
        .await?;
    Ok(answered(&found))
}

async fn reach(State(app): Shared, body: Result<Bytes, BytesRejection>) -> Answer {
    let question: Question = read(body)?;
    let case = Arc::clone(&app.case);
    let (turns, kind) = if question.quick {
        (&app.quick_reach, "quick reach")
    } else {
        (&app.exact, "reach")
    };
    let turn = question.turn(kind);
    let threads = app.threads;
    let work = move || live::reach(&case, &question.aim, question.quick, threads);
    let found = turns.run(turn, work).await?;
    Ok(answered(&found))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct EntriesQuestion {
    aim: GoalAim,
    #[serde(default)]
    robot: bool,
    #[serde(default)]
    page: Option<String>,
    #[serde(default)]
    turn: Option<u64>,
}

async fn planned_entries(State(app): Shared, body: Result<Bytes, BytesRejection>) -> Answer {
    let question: EntriesQuestion = read(body)?;
    let case = Arc::clone(&app.case);
    let turn = turn_of("entries", question.page.as_ref(), question.turn);
    let threads = app.threads;
    let work = move |cancel: &AtomicBool| {
        let control = Control {
            threads,
            cancel,
            progress: &Silent,
        };
        entries::entries(&case, &question.aim, question.robot, &control)
    };
    let found = app.exact.run_until(turn, work).await?;
    match found.transpose() {
        Some(found) => Ok(answered(&found)),
        None => Err(
            Problem::new(StatusCode::CONFLICT, "superseded by a later request")
                .with("overtaken", &true),
        ),
    }
}

async fn planned_motion(State(app): Shared, body: Result<Bytes, BytesRejection>) -> Answer {
    let question: Question = read(body)?;
    let case = Arc::clone(&app.case);
    let turn = question.turn("motion");
    let work = move || {
        let configuration = question.configuration.as_deref().unwrap_or_default();
        motion::motion(&case, &question.aim, configuration)
    };
    Ok(answered(&app.exact.run(turn, work).await?))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PeopleQuestion {
    aim: Aim,
    /// The posture at the needle.
    joints_rad: [f64; 6],
    #[serde(default)]
    page: Option<String>,
    #[serde(default)]
    turn: Option<u64>,
}

async fn people_at(State(app): Shared, body: Result<Bytes, BytesRejection>) -> Answer {
    let question: PeopleQuestion = read(body)?;
    let case = Arc::clone(&app.case);
    let turn = turn_of("people", question.page.as_ref(), question.turn);
    let work = move || people::people(&case, &question.aim, &question.joints_rad);
    Ok(answered(&app.exact.run(turn, work).await?))
}

/// A folder that cannot be read or written any more.
fn gone(message: String) -> Problem {
    Problem::new(StatusCode::GONE, message).hint(
        "the folder may have been moved or deleted; the page keeps its contents and saves them once the folder is back",
    )
}

async fn session(State(app): Shared) -> Answer {
    let session = app
        .session
        .read()
        .map_err(|finding| gone(finding.message))?;
    Ok(json_response(&session))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SessionQuestion {
    version: u64,
    state: SessionState,
}

async fn keep_session(State(app): Shared, body: Result<Bytes, BytesRejection>) -> Answer {
    let SessionQuestion { version, state } = read(body)?;
    let _one = app.writing.lock().await;
    match app.session.write(version, state) {
        Ok(session) => Ok(json_response(&json!({"version": session.version}))),
        Err(NotKept::Changed(session)) => Err(Problem::new(
            StatusCode::CONFLICT,
            "the session was changed in another tab",
        )
        .hint("load the other version (undo brings this one back), or keep this version")
        .with("session", &session)),
        Err(NotKept::Wrong(problem)) => {
            Err(Problem::new(StatusCode::UNPROCESSABLE_ENTITY, problem))
        }
        Err(NotKept::Folder(problem)) => Err(gone(problem)),
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlanQuestion {
    aim: Aim,
    #[serde(default)]
    configuration: Option<String>,
    #[serde(default)]
    name: Option<String>,
    #[serde(default)]
    consent: Consent,
    /// Of a simulation.
    #[serde(default)]
    engine: Option<Engine>,
}

impl From<NotWritten> for Problem {
    fn from(why: NotWritten) -> Self {
        match why {
            NotWritten::Refused(refusal) => refusal.into(),
            NotWritten::Exists { file, free } => {
                Self::new(StatusCode::CONFLICT, format!("{file} exists already"))
                    .hint("overwrite it, or choose another name")
                    .with("ask", &"overwrite")
                    .with("file", &file)
                    .with("free", &free)
            }
            NotWritten::NotAllowed(why) => {
                Self::new(StatusCode::CONFLICT, format!("needle path rejected: {why}"))
                    .hint("the file will be marked as rejected")
                    .with("ask", &"refused")
            }
        }
    }
}

async fn written(app: &Arc<App>, question: PlanQuestion) -> Result<Written, Problem> {
    let case = Arc::clone(&app.case);
    let _one = app.writing.lock().await;
    let threads = app.threads;
    let work = move |cancel: &AtomicBool| {
        let control = Control {
            threads,
            cancel,
            progress: &Silent,
        };
        let name = question.name.as_deref().unwrap_or(PLAN_FILE);
        write_plan(
            &case,
            &question.aim,
            question.configuration.as_deref(),
            name,
            question.consent,
            &control,
        )
    };
    Ok(app.exact.run_until(None, work).await??)
}

fn file_name(path: &std::path::Path) -> String {
    path.file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned()
}

async fn plan(State(app): Shared, body: Result<Bytes, BytesRejection>) -> Answer {
    let plan = written(&app, read(body)?).await?;
    Ok(json_response(&json!({
        "file": file_name(&plan.path),
        "path": plan.path.display().to_string(),
        "left_out": plan.left_out,
        "refusal": plan.refusal,
    })))
}

async fn simulate(State(app): Shared, body: Result<Bytes, BytesRejection>) -> Answer {
    let question: PlanQuestion = read(body)?;
    let engine = question.engine.unwrap_or(Engine::Rapier);
    let plan = written(&app, question).await?;
    let progress = app.simulation.start(&plan.path, plan.left_out, engine)?;
    let cookie = format!(
        "{COOKIE}={}; HttpOnly; SameSite=Strict; Path=/results",
        app.results.text()
    );
    Ok(([(header::SET_COOKIE, cookie)], json_response(&progress)).into_response())
}

async fn simulated(State(app): Shared) -> Response {
    json_response(&app.simulation.progress())
}

async fn cancel(State(app): Shared) -> Response {
    json_response(&app.simulation.cancel())
}

async fn report(State(app): Shared, method: Method, headers: HeaderMap) -> Answer {
    check_cookie(&headers, &app.results)?;
    let path = app.simulation.report().ok_or_else(|| {
        Problem::new(StatusCode::NOT_FOUND, "there is no report yet").hint("simulate a plan first")
    })?;
    let read = tokio::task::spawn_blocking(move || std::fs::read(path)).await;
    let bytes = read
        .map_err(|error| gone(error.to_string()))?
        .map_err(|error| gone(format!("the report cannot be read: {error}")))?;
    let headers = [
        (header::CONTENT_TYPE, "text/html; charset=utf-8"),
        (header::CONTENT_SECURITY_POLICY, page::REPORT_POLICY),
    ];
    let bytes = if method == Method::HEAD {
        Vec::new()
    } else {
        bytes
    };
    Ok((headers, bytes).into_response())
}
