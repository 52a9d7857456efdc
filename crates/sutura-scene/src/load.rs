//! From the text of a scene to the checked scene: the only reader of the format in `docs/formats.md`.

mod bodies;
mod cuts;
mod happening;
mod joints;
mod things;
mod watching;

use crate::curve::{self, Curve, Piece};
use crate::doc::{Doc, Location, Table, Value};
use crate::error::{SceneError, suggest};
use crate::expr::{At, Expr, Kind, Named, Names, Read, is_name, texts_match};
use crate::motion::{Ease, Goal, Key, Plan, Relative, Turning, When};
use crate::parted::Parting;
use crate::presets;
use crate::saved::{Event, SavedFile};
use crate::scene::{
    Action, BodyDef, Camera, CheckDef, End, Late, LoadDef, MOST_FRAMES, Moment, Mover, Phase, ProbeDef, ProfileDef,
    ReelDef, Scene, ShapeDef, Span, Step, Strength, Take, ThreadDef, Wanted, WeldDef, engine_place,
};
use crate::units::{Dim, Unit, parse_unit};
use std::path::{Path, PathBuf};
use sutura::glam::{DQuat, DVec3, EulerRot};
use sutura::math::{exp, frame_from_tangent, log};
use sutura::{
    Along, Closure, Friction, Geometry, Hold, Integrator, Material, PaperSettings, Place, Plasticity, Pose, Profile,
    ReelLaw, RestShape, RodSpec, Section, Settings, ShapeMotion, ShapeSpec, Shear, Solver, Stretch, SweepOrder,
    WeldRest, transported_frames,
};
use things::rest_lengths;

/// Reads a scene with some of its values set from outside (path and value); every problem found is in the error.
pub fn scene(text: &str, file_name: &str, settings: &[(String, String)]) -> Result<Scene, SceneError> {
    let doc = Doc::new(file_name, text, settings);
    let (mut document, errors) = toml::de::DeTable::parse_recoverable(doc.text());
    for e in &errors {
        doc.problem(e.span().map_or(0, |s| s.start), "", e.message().trim(), None);
    }
    // After a slip in the syntax what was recovered would only give follow-up problems.
    doc.verdict()?;
    for setting in doc.settings() {
        setting.apply(&mut document)?;
    }
    let root = Table::root(&doc, &document);
    let folder = Path::new(file_name).parent().map(Path::to_path_buf).unwrap_or_default();
    let mut loader = Loader {
        doc: &doc,
        folder,
        names: Names::default(),
        frame_rate: 60.0,
        surfaces: Vec::new(),
        threads: Vec::new(),
        own_threads: 0,
        extents: Vec::new(),
        shapes: Vec::new(),
        bodies: Vec::new(),
        reels: Vec::new(),
        grips: Vec::new(),
        loads: Vec::new(),
        phases: Vec::new(),
        profiles: Vec::new(),
    };
    let scene = loader.scene(&root, file_name);
    root.finish();
    doc.verdict()?;
    scene.ok_or_else(|| SceneError::of_file(file_name, "could not be read"))
}

/// Every table of a name, read and finished.
fn read_all<'d, T>(root: &Table<'d>, key: &str, read: impl Fn(&Table<'d>) -> Option<T>) -> Vec<T> {
    let one = |t: &Table<'d>| {
        let found = read(t);
        t.finish();
        found
    };
    root.tables(key).iter().filter_map(one).collect()
}

/// What is known while reading.
struct Loader<'d> {
    doc: &'d Doc,
    folder: PathBuf,
    names: Names,
    frame_rate: f64,
    surfaces: Vec<String>,
    /// Those of the scene, then the parts that cuts make, as the actions are read.
    threads: Vec<ThreadDef>,
    own_threads: usize,
    /// The rest lengths of the elements of each thread \[m\] at the action that is read, and whether it is closed.
    extents: Vec<(Vec<f64>, bool)>,
    shapes: Vec<ShapeDef>,
    bodies: Vec<BodyDef>,
    reels: Vec<ReelDef>,
    grips: Vec<String>,
    loads: Vec<String>,
    phases: Vec<String>,
    profiles: Vec<String>,
}

/// Most substeps of a frame.
const MOST_SUBSTEPS: i64 = 100_000;

impl<'d> Loader<'d> {
    fn scene(&mut self, root: &Table<'d>, file_name: &str) -> Option<Scene> {
        let name = Path::new(file_name).file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let title = root.text("title").map_or(name.clone(), std::borrow::Cow::into_owned);
        let description = root.text("description").map_or(String::new(), |t| t.trim().into());
        let frame_rate = positive(root, "frame_rate", Dim::RATE).unwrap_or(60.0);
        if !(1.0..=100_000.0).contains(&frame_rate)
            && let Some(v) = root.get("frame_rate")
        {
            v.problem("frames per second must be from 1 to 100000", None);
        }
        let record_every = root.get("record_every").and_then(|v| v.integer(1, 1_000_000)).unwrap_or(1) as u64;
        let seed = root.get("seed").and_then(|v| v.integer(0, i64::MAX)).unwrap_or(1) as u64;
        let audit = root.truth_or("audit", true);
        let stills = self.stills(root);
        let camera = root.get("camera").and_then(|v| camera(&v.table()?));
        let start = root.get("start").and_then(|v| Some((self.folder.join(v.text()?.as_ref()), v.location())));

        self.surfaces = vec!["thread".into(), "shape".into()];
        self.frame_rate = frame_rate;
        let (settings, solver_location) = self.solver(root);
        for table in root.tables("thread") {
            self.thread(&table);
            table.finish();
        }
        for table in root.tables("shape") {
            self.shape(&table);
            table.finish();
        }
        // After the shapes of their own, so that these have the numbers of their tables.
        let (bodies, needles) = (root.tables("body"), root.tables("needle"));
        bodies.iter().for_each(|table| self.body(table));
        if !root.has("thread") && !root.has("body") {
            root.problem("there is no `[[thread]]` and no `[[body]]`", None);
        }
        self.own_threads = self.threads.len();
        self.extents = self.threads.iter().map(|t| (rest_lengths(&t.spec), t.spec.closure.is_some())).collect();
        self.collect_names(root, start.as_ref());
        let frictions = self.friction(root);
        let mut welds = read_all(root, "weld", |t| self.weld(t));
        welds.extend(needles.iter().filter_map(|table| self.needle(table)));
        for (i, table) in bodies.iter().chain(&needles).enumerate() {
            if let Some(by) = table.get("held_by").and_then(|v| self.find_body(&v)) {
                self.bodies[i].held_by = Some(by);
            }
            table.finish();
        }
        let joints = read_all(root, "joint", |t| self.joint(t));
        self.reels = read_all(root, "reel", |t| self.reel(t));

        let mut initial = Vec::new();
        for table in root.tables("grip") {
            if let Some(grip) = table.need("name", "the name of the grip").and_then(|v| self.find_grip(&v)) {
                initial.extend(self.take(&table, grip, 0.0).map(|action| Step { action, location: table.location() }));
                initial.extend(
                    self.drive_keys(&table, Mover::Grip(grip))
                        .map(|action| Step { action, location: table.location() }),
                );
            }
            table.finish();
        }
        for table in root.tables("load") {
            if let Some(load) = table.need("name", "the name of the load").and_then(|v| self.find_load(&v)) {
                initial.extend(self.load(&table, load).map(|action| Step { action, location: table.location() }));
            }
            table.finish();
        }

        // Before the phases, whose conditions may name them; an expression may use the probes before its own.
        let probes = self.probes(root);
        let phase_tables = root.tables("phase");
        if phase_tables.is_empty() {
            root.problem(
                "there is no `[[phase]]`: nothing would happen",
                Some("for instance [[phase]] with name = \"run\" and duration = \"1 s\"".into()),
            );
        }
        let phases: Vec<Phase> = phase_tables.iter().enumerate().filter_map(|(i, t)| self.phase(t, i)).collect();
        let frames = frame_rate * phases.iter().map(Phase::longest).sum::<f64>();
        let longest = phase_tables.iter().zip(&phases).max_by(|a, b| a.1.longest().total_cmp(&b.1.longest()));
        if let Some((table, phase)) = longest.filter(|_| frames > MOST_FRAMES) {
            let problem = format!(
                "it may take {:e} s: with the other phases {frames:e} frames, at most {MOST_FRAMES:e} are run",
                phase.longest()
            );
            table.problem(problem, None);
        }
        let profiles = root.tables("profile").iter().filter_map(|t| self.profile(t)).collect();
        let checks = root.tables("check").iter().enumerate().filter_map(|(i, t)| self.check(t, i)).collect();

        self.check_order(&initial, &phases, start.is_some());
        Some(Scene {
            name,
            title,
            description,
            frame_rate,
            stills,
            camera,
            record_every,
            audit,
            seed,
            settings,
            frictions,
            solver_location,
            threads: std::mem::take(&mut self.threads),
            own_threads: self.own_threads,
            shapes: std::mem::take(&mut self.shapes),
            bodies: std::mem::take(&mut self.bodies),
            welds,
            joints,
            reels: std::mem::take(&mut self.reels),
            grips: std::mem::take(&mut self.grips),
            loads: std::mem::take(&mut self.loads),
            start,
            initial,
            phases,
            probes,
            profiles,
            checks,
        })
    }

    fn stills(&self, root: &Table<'d>) -> Vec<f64> {
        let Some(value) = root.get("stills") else { return vec![f64::INFINITY] };
        let items = value.array("an array of times, such as [\"0 s\", \"1.5 s\", \"end\"]").unwrap_or_default();
        items
            .iter()
            .filter_map(|v| match v.is_text().then(|| v.text()).flatten() {
                Some(t) if t == "end" => Some(f64::INFINITY),
                _ => v.quantity(Dim::TIME),
            })
            .collect()
    }
    // ---- names ----

    /// Every name is known before anything that may refer to it is read.
    fn collect_names(&mut self, root: &Table<'d>, start: Option<&(PathBuf, Location)>) {
        for (i, t) in root.tables("thread").iter().enumerate() {
            self.add_name(t, "name", Named::Thread(i));
        }
        for (i, t) in root.tables("shape").iter().enumerate() {
            self.add_name(t, "name", Named::Shape(i));
        }
        for (i, t) in root.tables("body").iter().chain(&root.tables("needle")).enumerate() {
            self.add_name(t, "name", Named::Body(i));
        }
        for (i, t) in root.tables("joint").iter().enumerate() {
            self.add_name(t, "name", Named::Joint(i));
        }
        if let Some((path, location)) = start {
            match SavedFile::read(path) {
                Ok(saved) => {
                    for grip in saved.grips() {
                        self.add_grip(&grip);
                    }
                    for load in saved.loads() {
                        self.add_load(&load);
                    }
                    self.take_up_cuts(&saved, location);
                }
                Err(e) => self.doc.problem_at(location, format!("{}: {e}", path.display())),
            }
        }
        for t in root.tables("grip") {
            if let Some(name) = t.get("name").filter(Value::is_text).and_then(|v| self.checked_name(&v)) {
                self.add_grip(&name);
            }
        }
        for t in root.tables("load") {
            if let Some(name) = t.get("name").filter(Value::is_text).and_then(|v| self.checked_name(&v)) {
                self.add_load(&name);
            }
        }
        self.name_parts(root);
        for phase in root.tables("phase") {
            self.phases.push(
                phase
                    .get("name")
                    .filter(Value::is_text)
                    .and_then(|v| v.text())
                    .map_or(String::new(), std::borrow::Cow::into_owned),
            );
            for action in phase.tables("action") {
                if let Some(name) = action.get("take").filter(Value::is_text).and_then(|v| self.checked_name(&v)) {
                    self.add_grip(&name);
                }
                if let Some(name) = action.get("load").filter(Value::is_text).and_then(|v| self.checked_name(&v)) {
                    self.add_load(&name);
                }
            }
        }
    }
    fn checked_name(&self, value: &Value<'d>) -> Option<String> {
        let name = value.text()?;
        if is_name(&name) {
            return Some(name.into_owned());
        }
        value.problem(format!("`{name}` cannot be a name: letters, digits and _ only, a letter first"), None);
        None
    }
    fn add_name(&mut self, table: &Table<'d>, key: &str, what: Named) {
        if let Some(value) = table.get(key)
            && let Some(name) = self.checked_name(&value)
            && !self.names.add(&name, what)
        {
            value.problem(format!("the name `{name}` is taken"), None);
        }
    }
    fn add_grip(&mut self, name: &str) {
        if self.names.add(name, Named::Grip(self.grips.len())) {
            self.grips.push(name.into());
        }
    }
    fn add_load(&mut self, name: &str) {
        // Loads have names of their own: no expression asks for one.
        if !self.loads.iter().any(|l| l == name) {
            self.loads.push(name.into());
        }
    }
    fn find<T>(&self, value: &Value<'d>, what: &str, pick: impl Fn(Named) -> Option<T>) -> Option<T> {
        let name = value.text()?;
        let found = self.names.get(&name).and_then(&pick);
        if found.is_none() {
            value.problem(
                format!("no {what} is called `{name}`"),
                suggest(&name, self.names.which(|n| pick(n).is_some())),
            );
        }
        found
    }
    fn find_thread(&self, value: &Value<'d>) -> Option<usize> {
        let found = self.find(value, "thread", |n| if let Named::Thread(i) = n { Some(i) } else { None })?;
        if found < self.threads.len() {
            return Some(found);
        }
        value.problem(format!("`{}` is not cut off yet then", value.text()?), None);
        None
    }
    fn find_grip(&self, value: &Value<'d>) -> Option<usize> {
        self.find(value, "grip", |n| if let Named::Grip(i) = n { Some(i) } else { None })
    }
    fn find_body(&self, value: &Value<'d>) -> Option<usize> {
        self.find(value, "body", |n| if let Named::Body(i) = n { Some(i) } else { None })
    }
    fn find_load(&self, value: &Value<'d>) -> Option<usize> {
        let name = value.text()?;
        let found = self.loads.iter().position(|l| *l == name);
        if found.is_none() {
            value.problem(format!("no load is called `{name}`"), suggest(&name, self.loads.iter().map(String::as_str)));
        }
        found
    }
    fn find_mover(&self, value: &Value<'d>) -> Option<Mover> {
        self.find(value, "grip, shape or body", |n| match n {
            Named::Grip(i) => Some(Mover::Grip(i)),
            Named::Shape(i) => Some(Mover::Shape(i)),
            Named::Body(i) => Some(Mover::Body(i)),
            _ => None,
        })
    }
    fn find_phase(&self, value: &Value<'d>) -> Option<usize> {
        let name = value.text()?;
        let found = self.phases.iter().position(|p| *p == name);
        if found.is_none() {
            value.problem(
                format!("no phase is called `{name}`"),
                suggest(&name, self.phases.iter().map(String::as_str)),
            );
        }
        found
    }
    /// The thread named by `thread`; the only one when there is one.
    fn thread_of(&self, table: &Table<'d>) -> Option<usize> {
        match table.get("thread") {
            Some(v) => self.find_thread(&v),
            None if self.own_threads == 1 => Some(0),
            None => {
                table.problem("`thread` is missing: which of the threads?", None);
                None
            }
        }
    }
    fn surface(&mut self, table: &Table<'d>, default: u32) -> u32 {
        let Some(name) = table.text("surface") else { return default };
        if let Some(i) = self.surfaces.iter().position(|s| *s == name) {
            return i as u32;
        }
        self.surfaces.push(name.into_owned());
        self.surfaces.len() as u32 - 1
    }
    fn expression(&self, value: &Value<'d>) -> Option<Expr> {
        let text = value.text()?;
        match Expr::parse(&text, &self.names) {
            Ok(e) => Some(e),
            Err((message, help)) => {
                value.problem(format!("\"{text}\": {message}"), help);
                None
            }
        }
    }
    fn condition(&self, value: &Value<'d>) -> Option<Expr> {
        let e = self.expression(value)?;
        if *e.kind() != Kind::Truth {
            value.problem("wanted a condition such as \"tension(left) >= 2 N\"", None);
            return None;
        }
        Some(e)
    }
    /// Text of a file named in the scene.
    fn file(&self, value: &Value<'d>) -> Option<String> {
        let path = self.folder.join(value.text()?.as_ref());
        match std::fs::read_to_string(&path) {
            Ok(text) => Some(text),
            Err(e) => {
                value.problem(format!("{}: {e}", path.display()), None);
                None
            }
        }
    }

    // ---- solver and friction ----

    fn solver(&self, root: &Table<'d>) -> (Settings, Location) {
        let mut settings = Settings::default();
        let Some(table) = root.get("solver").and_then(|v| v.table()) else { return (settings, root.location()) };
        if let Some(v) = table.vector("gravity", Dim::ACCELERATION) {
            settings.gravity = v;
        }
        if let Some(v) = table.get("substeps") {
            settings.substep = 1.0 / (self.frame_rate * v.integer(1, MOST_SUBSTEPS).unwrap_or(1) as f64);
            if table.has("substep") {
                v.problem("`substep` and `substeps` exclude each other", None);
            }
        }
        self.solver_numbers(&table, &mut settings);
        if let Some(n) = table.get("halvings").and_then(|v| v.integer(0, 12)) {
            settings.halvings = n as u32;
        }
        let integrators = [("implicit_euler", Integrator::ImplicitEuler), ("tr_bdf2", Integrator::TrBdf2)];
        if let Some(integrator) = table.get("integrator").and_then(|v| v.choice(&integrators)) {
            settings.integrator = integrator;
        }
        let methods = [("direct", Solver::Direct), ("paper", Solver::Paper(PaperSettings::default()))];
        if let Some(method) = table.get("method").and_then(|v| v.choice(&methods)) {
            settings.solver = method;
        }
        if let Some(value) = table.get("paper") {
            match (&mut settings.solver, value.table()) {
                (Solver::Paper(numbers), Some(table)) => paper_numbers(&table, numbers),
                (Solver::Direct, Some(_)) => value.problem(
                    "numbers of the paper's solver, which is not asked for",
                    Some("add method = \"paper\"".into()),
                ),
                (_, None) => {}
            }
        }
        let location = table.location();
        table.finish();
        (settings, location)
    }
    /// The numbers that an action may change too.
    fn solver_numbers(&self, table: &Table<'d>, settings: &mut Settings) {
        if let Some(v) = positive(table, "substep", Dim::TIME) {
            let substeps = 1.0 / (self.frame_rate * v);
            if substeps > MOST_SUBSTEPS as f64 * (1.0 + 1e-9)
                && let Some(value) = table.get("substep")
            {
                value.problem(
                    format!("{v:e} s: {substeps:e} substeps in a frame, at most {MOST_SUBSTEPS} are taken"),
                    None,
                );
            }
            settings.substep = v;
        }
        if let Some(v) = table.get("newton_max").and_then(|v| v.integer(1, 1000)) {
            settings.newton_max = v as u32;
        }
        if let Some(v) = in_range(table, "tolerance", Dim::ANGLE, 1e-15, 0.1) {
            settings.tolerance = v;
        }
        if let Some(v) = in_range(table, "linear_damping", Dim::NUMBER, 0.0, 1.0 - 1e-12) {
            settings.linear_damping = v;
        }
        if let Some(v) = in_range(table, "angular_damping", Dim::NUMBER, 0.0, 1.0 - 1e-12) {
            settings.angular_damping = v;
        }
        // Beyond any physical rate, and far from where its product with a mass is no number.
        if let Some(v) = in_range(table, "linear_drag", Dim::RATE, 0.0, 1e12) {
            settings.linear_drag = v;
        }
        if let Some(v) = in_range(table, "angular_drag", Dim::RATE, 0.0, 1e12) {
            settings.angular_drag = v;
        }
    }

    fn friction(&mut self, root: &Table<'d>) -> Vec<(u32, u32, Friction, Location)> {
        let mut out = Vec::new();
        let Some(table) = root.get("friction").and_then(|v| v.table()) else { return out };
        for pair in table.tables("pair") {
            let surfaces = pair.need("between", "the names of two surfaces").and_then(|v| self.two_surfaces(&v));
            if let (Some((a, b)), Some(f)) = (surfaces, coefficients(&pair)) {
                out.push((a, b, f, pair.location()));
            }
            pair.finish();
        }
        // The default stands for every pair that is not given.
        if let Some(v) = table.get("default") {
            let default = if v.is_table() {
                v.table().and_then(|t| {
                    let f = coefficients(&t);
                    t.finish();
                    f
                })
            } else {
                v.quantity(Dim::NUMBER).and_then(|mu| checked_friction(&v, mu, mu))
            };
            if let Some(f) = default {
                let n = self.surfaces.len() as u32;
                let given: Vec<(u32, u32)> = out.iter().map(|(a, b, ..)| (*a.min(b), *a.max(b))).collect();
                for a in 0..n {
                    for b in a..n {
                        if !given.contains(&(a, b)) {
                            out.push((a, b, f, v.location()));
                        }
                    }
                }
            }
        }
        table.finish();
        out
    }
    fn two_surfaces(&self, value: &Value<'d>) -> Option<(u32, u32)> {
        let names = value.array("two names of surfaces")?;
        let [a, b] = names.as_slice() else {
            value.problem("wanted the names of two surfaces", None);
            return None;
        };
        let find = |v: &Value<'d>| {
            let name = v.text()?;
            let found = self.surfaces.iter().position(|s| *s == name);
            if found.is_none() {
                v.problem(
                    format!("no thread or shape has the surface `{name}`"),
                    suggest(&name, self.surfaces.iter().map(String::as_str)),
                );
            }
            found.map(|i| i as u32)
        };
        Some((find(a)?, find(b)?))
    }
}

/// `unit = "mm"` of a file of lengths; meters otherwise.
fn file_unit(table: &Table<'_>) -> Option<f64> {
    let Some(v) = table.get("unit") else { return Some(1.0) };
    let name = v.text()?;
    match parse_unit(&name) {
        Ok(u) if u.dim == Dim::LENGTH => Some(u.size),
        _ => {
            v.problem(format!("`{name}` is not a unit of length"), None);
            None
        }
    }
}

fn positive_value(value: &Value<'_>, dim: Dim) -> Option<f64> {
    let v = value.quantity(dim)?;
    if v > 0.0 {
        return Some(v);
    }
    value.problem(format!("{v} must be > 0"), None);
    None
}

fn positive(table: &Table<'_>, key: &str, dim: Dim) -> Option<f64> {
    positive_value(&table.get(key)?, dim)
}

fn in_range_value(value: &Value<'_>, dim: Dim, from: f64, to: f64) -> Option<f64> {
    let v = value.quantity(dim)?;
    if (from..=to).contains(&v) {
        return Some(v);
    }
    value.problem(
        if to > 1e8 { format!("{v} must be at least {from}") } else { format!("{v} must be from {from} to {to}") },
        None,
    );
    None
}

fn in_range(table: &Table<'_>, key: &str, dim: Dim, from: f64, to: f64) -> Option<f64> {
    in_range_value(&table.get(key)?, dim, from, to)
}

/// Numbers of the paper's solver.
fn paper_numbers(table: &Table<'_>, numbers: &mut PaperSettings) {
    if let Some(n) = table.get("iterations").and_then(|v| v.integer(1, 100_000)) {
        numbers.iterations = n as u32;
    }
    let part = |key: &str, to: &mut f64| *to = in_range(table, key, Dim::NUMBER, 0.0, 1.0).unwrap_or(*to);
    part("stretch_shear", &mut numbers.stretch_shear);
    part("twist", &mut numbers.twist);
    part("friction", &mut numbers.friction);
    if let Some(value) = table.get("bend")
        && let Some(bend) = value.quantities(Dim::NUMBER, "two numbers, for bending about d1 and d2")
    {
        match bend.as_slice() {
            [a, b] if bend.iter().all(|k| (0.0..=1.0).contains(k)) => numbers.bend = [*a, *b],
            _ => value.problem("wanted two numbers from 0 to 1", None),
        }
    }
    numbers.frame_inertia = positive(table, "frame_inertia", Dim::NUMBER).unwrap_or(numbers.frame_inertia);
    numbers.direct_distance = table.truth_or("ddc", numbers.direct_distance);
    let orders = [("natural", SweepOrder::Natural), ("two_color", SweepOrder::TwoColor)];
    numbers.order = table.get("order").and_then(|v| v.choice(&orders)).unwrap_or(numbers.order);
    table.finish();
}

/// `mu`, or `stick` and `slide`.
fn coefficients(table: &Table<'_>) -> Option<Friction> {
    match (table.get("mu"), table.get("stick")) {
        (Some(v), None) => {
            let mu = v.quantity(Dim::NUMBER)?;
            checked_friction(&v, mu, mu)
        }
        (None, Some(v)) => {
            let stick = v.quantity(Dim::NUMBER)?;
            let slide = match table.get("slide") {
                Some(s) => s.quantity(Dim::NUMBER)?,
                None => stick,
            };
            checked_friction(&v, stick, slide)
        }
        _ => {
            table.problem("either `mu`, or `stick` and `slide`", None);
            None
        }
    }
}

fn checked_friction(value: &Value<'_>, stick: f64, slide: f64) -> Option<Friction> {
    if slide >= 0.0 && slide <= stick {
        return Some(Friction { stick, slide });
    }
    value.problem("coefficients of friction must be 0 <= slide <= stick", None);
    None
}

/// `orientation = { axis, angle }`, `{ euler }`, `{ quaternion }` or `{ z, x }`.
fn orientation(table: &Table<'_>, default: Option<DQuat>) -> Option<DQuat> {
    let Some(value) = table.get("orientation") else { return default };
    let t = value.table()?;
    let q = if t.has("axis") {
        let (axis, angle) = (t.get("axis").and_then(|v| v.direction()), t.need_quantity("angle", Dim::ANGLE));
        axis.zip(angle).map(|(axis, angle)| exp(axis * angle))
    } else if let Some(v) = t.get("euler") {
        v.vector(Dim::ANGLE).map(|a| DQuat::from_euler(EulerRot::ZYX, a.z, a.y, a.x))
    } else if let Some(v) = t.get("quaternion") {
        match v.quantities(Dim::NUMBER, "four numbers x, y, z, w")?.as_slice() {
            [x, y, z, w] => {
                let q = DQuat::from_xyzw(*x, *y, *z, *w);
                if q.length() > 1e-9 && q.length().is_finite() {
                    Some(q.normalize())
                } else {
                    v.problem("the quaternion is zero or too large", None);
                    None
                }
            }
            _ => {
                v.problem("wanted four numbers x, y, z, w", None);
                None
            }
        }
    } else if let Some(v) = t.get("z") {
        let z = v.direction();
        let x = t.get("x").and_then(|v| v.direction()).unwrap_or(DVec3::X);
        z.map(|z| frame_from_tangent(z, x))
    } else {
        value.problem("one of: axis with angle, euler, quaternion, z (the direction of the z axis)", None);
        None
    };
    t.finish();
    q
}

/// `position` and `orientation`.
fn pose(table: &Table<'_>) -> Pose {
    let position = table.vector("position", Dim::LENGTH).unwrap_or(DVec3::ZERO);
    Pose::new(position, orientation(table, Some(DQuat::IDENTITY)).unwrap_or(DQuat::IDENTITY))
}

fn camera(t: &Table<'_>) -> Option<Camera> {
    let from = t.need("from", "the direction from the scene toward the camera").and_then(|v| v.direction());
    let up = t.get("up").and_then(|v| v.direction()).unwrap_or(DVec3::Z);
    let look_at = t.vector("look_at", Dim::LENGTH);
    let width = positive(t, "width", Dim::LENGTH);
    t.finish();
    let from = from?;
    if from.cross(up).length() < 1e-6 {
        t.problem("`from` and `up` are parallel", None);
        return None;
    }
    Some(Camera { look_at, from, up, width })
}
