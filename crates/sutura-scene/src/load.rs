//! From the text of a scene to the checked scene: the only reader of the format in `docs/formats.md`.

use crate::curve::{self, Curve, Piece};
use crate::doc::{Doc, Location, Table, Value};
use crate::error::{SceneError, suggest};
use crate::expr::{At, Expr, Kind, Named, Names, Read, is_name, texts_match};
use crate::motion::{Ease, Goal, Key, Plan, Relative, Turning, When};
use crate::presets;
use crate::saved::SavedFile;
use crate::scene::{
    Action, Camera, CheckDef, End, Late, LoadDef, Moment, Mover, Phase, ProbeDef, ProfileDef, Scene, ShapeDef, Span, Step, Take, ThreadDef, Wanted,
    engine_place,
};
use crate::units::{Dim, Unit, parse_unit};
use std::path::{Path, PathBuf};
use sutura::glam::{DQuat, DVec3, EulerRot};
use sutura::math::{exp, frame_from_tangent, log};
use sutura::{
    Friction, Geometry, Hold, Material, Place, Plasticity, Pose, RestShape, RodSpec, Settings, ShapeMotion, ShapeSpec, Shear, Stretch, transported_frames,
};

/// Most elements of one thread: far beyond what runs in real time, and a slip of the pen must not fill the memory.
const MAX_ELEMENTS: i64 = 200_000;

/// Longest time of a phase that ends by a condition, unless it says otherwise \[s\].
const DEFAULT_MAX_DURATION: f64 = 60.0;

/// Reads a scene; every problem found is in the error.
pub fn scene(text: &str, file_name: &str) -> Result<Scene, SceneError> {
    let doc = Doc::new(file_name, text);
    let (document, errors) = toml::de::DeTable::parse_recoverable(doc.text());
    for e in &errors {
        doc.problem(e.span().map_or(0, |s| s.start), "", e.message().trim(), None);
    }
    // After a slip in the syntax what was recovered would only give follow-up problems.
    doc.verdict()?;
    let root = Table::root(&doc, &document);
    let folder = Path::new(file_name).parent().map(Path::to_path_buf).unwrap_or_default();
    let mut loader = Loader {
        doc: &doc,
        folder,
        names: Names::default(),
        surfaces: Vec::new(),
        threads: Vec::new(),
        shapes: Vec::new(),
        grips: Vec::new(),
        loads: Vec::new(),
        phases: Vec::new(),
    };
    let scene = loader.scene(&root, file_name);
    root.finish();
    doc.verdict()?;
    scene.ok_or_else(|| SceneError::of_file(file_name, "could not be read"))
}

/// What is known while reading.
struct Loader<'d> {
    doc: &'d Doc,
    folder: PathBuf,
    names: Names,
    surfaces: Vec<String>,
    threads: Vec<ThreadDef>,
    shapes: Vec<ShapeDef>,
    grips: Vec<String>,
    loads: Vec<String>,
    phases: Vec<String>,
}

/// Dimension of each number of a profile, in the engine's SI units.
type ProfileColumn = (&'static str, Read, &'static [&'static str], &'static str);

const PROFILES: &[ProfileColumn] = &[
    ("position", Read::Position, &["x", "y", "z"], "m"),
    ("tension", Read::Tension, &["tension"], "N"),
    ("shear", Read::Shear, &["shear"], "N"),
    ("moment", Read::Moment, &["m1", "m2", "m3"], "N m"),
    ("bending", Read::Bending, &["bending"], "N m"),
    ("torsion", Read::Torsion, &["torsion"], "N m"),
    ("curvature", Read::Curvature, &["curvature"], "1/m"),
    ("twist_rate", Read::TwistRate, &["twist_rate"], "rad/m"),
    ("speed", Read::Speed, &["speed"], "m/s"),
];

impl<'d> Loader<'d> {
    fn scene(&mut self, root: &Table<'d>, file_name: &str) -> Option<Scene> {
        let name = Path::new(file_name).file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let title = root.text("title").map_or(name.clone(), |t| t.into_owned());
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
        let (settings, solver_location) = self.solver(root, frame_rate);
        for table in root.tables("thread") {
            self.thread(&table);
            table.finish();
        }
        for table in root.tables("shape") {
            self.shape(&table);
            table.finish();
        }
        if self.threads.is_empty() && root.tables("thread").is_empty() {
            root.problem("there is no `[[thread]]`", None);
        }
        self.collect_names(root, start.as_ref());
        let frictions = self.friction(root);

        let mut initial = Vec::new();
        for table in root.tables("grip") {
            if let Some(grip) = table.need("name", "the name of the grip").and_then(|v| self.find_grip(&v)) {
                initial.extend(self.take(&table, grip, 0.0).map(|action| Step { action, location: table.location() }));
                initial.extend(self.drive_keys(&table, Mover::Grip(grip)).map(|action| Step { action, location: table.location() }));
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
            root.problem("there is no `[[phase]]`: nothing would happen", Some("for instance [[phase]] with name = \"run\" and duration = \"1 s\"".into()));
        }
        let phases: Vec<Phase> = phase_tables.iter().enumerate().filter_map(|(i, t)| self.phase(t, i)).collect();
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
            shapes: std::mem::take(&mut self.shapes),
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
        if let Some((path, location)) = start {
            match SavedFile::read(path) {
                Ok(saved) => {
                    for grip in saved.grips() {
                        self.add_grip(&grip);
                    }
                    for load in saved.loads() {
                        self.add_load(&load);
                    }
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
        for phase in root.tables("phase") {
            self.phases.push(phase.get("name").filter(Value::is_text).and_then(|v| v.text()).map_or(String::new(), |t| t.into_owned()));
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
            value.problem(format!("no {what} is called `{name}`"), suggest(&name, self.names.which(|n| pick(n).is_some())));
        }
        found
    }
    fn find_thread(&self, value: &Value<'d>) -> Option<usize> {
        // A thread whose table had a problem has a name but no entry.
        self.find(value, "thread", |n| if let Named::Thread(i) = n { Some(i) } else { None })
    }
    fn find_grip(&self, value: &Value<'d>) -> Option<usize> {
        self.find(value, "grip", |n| if let Named::Grip(i) = n { Some(i) } else { None })
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
        self.find(value, "grip or shape", |n| match n {
            Named::Grip(i) => Some(Mover::Grip(i)),
            Named::Shape(i) => Some(Mover::Shape(i)),
            _ => None,
        })
    }
    fn find_phase(&self, value: &Value<'d>) -> Option<usize> {
        let name = value.text()?;
        let found = self.phases.iter().position(|p| *p == name);
        if found.is_none() {
            value.problem(format!("no phase is called `{name}`"), suggest(&name, self.phases.iter().map(String::as_str)));
        }
        found
    }
    /// The thread named by `thread`; the only one when there is one.
    fn thread_of(&self, table: &Table<'d>) -> Option<usize> {
        match table.get("thread") {
            Some(v) => self.find_thread(&v),
            None if self.threads.len() == 1 => Some(0),
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

    fn solver(&self, root: &Table<'d>, frame_rate: f64) -> (Settings, Location) {
        let mut settings = Settings::default();
        let Some(table) = root.get("solver").and_then(|v| v.table()) else { return (settings, root.location()) };
        if let Some(v) = table.vector("gravity", Dim::ACCELERATION) {
            settings.gravity = v;
        }
        if let Some(v) = table.get("substeps") {
            settings.substep = 1.0 / (frame_rate * v.integer(1, 100_000).unwrap_or(1) as f64);
            if table.has("substep") {
                v.problem("`substep` and `substeps` exclude each other", None);
            }
        }
        self.solver_numbers(&table, &mut settings);
        if let Some(n) = table.get("halvings").and_then(|v| v.integer(0, 12)) {
            settings.halvings = n as u32;
        }
        let location = table.location();
        table.finish();
        (settings, location)
    }
    /// The numbers that an action may change too.
    fn solver_numbers(&self, table: &Table<'d>, settings: &mut Settings) {
        if let Some(v) = positive(table, "substep", Dim::TIME) {
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
                v.problem(format!("no thread or shape has the surface `{name}`"), suggest(&name, self.surfaces.iter().map(String::as_str)));
            }
            found.map(|i| i as u32)
        };
        Some((find(a)?, find(b)?))
    }

    // ---- threads ----

    fn thread(&mut self, table: &Table<'d>) {
        let index = self.threads.len();
        let name = table.need("name", "the name of the thread").and_then(|v| v.text()).map_or(format!("thread{index}"), |t| t.into_owned());
        let radius = self.thickness(table);
        let material = self.material(table);
        let stretch = table.get("stretch").and_then(|v| v.choice(&[("elastic", Stretch::Elastic), ("inextensible", Stretch::Inextensible)]));
        let surface = self.surface(table, 0);
        let knot = table.truth_or("knot", false);
        let points = self.centerline(table, None);
        let hint = table.vector("d1", Dim::NUMBER);
        let twist = table.quantity_or("twist", Dim::ANGLE, 0.0);
        let rest_value = table.get("rest");
        let (Some(points), Some(radius), Some(material)) = (points, radius, material) else {
            // What is missing was reported; a stand-in keeps the numbers of the following threads right.
            if let Some(rest) = rest_value {
                let _ = self.rest(&rest, 1);
            }
            let spec = RodSpec::straight(DVec3::ZERO, DVec3::X, 1, 1e-3, Material::elastic(1e9, 1e3));
            self.threads.push(ThreadDef { name, spec, location: table.location(), knot });
            return;
        };
        let mut spec = RodSpec::new(points, radius, material);
        spec.stretch = stretch.unwrap_or(Stretch::Elastic);
        spec.surface = surface;
        if let Some(rest) = rest_value {
            spec.rest = self.rest(&rest, spec.centerline.len() - 1).unwrap_or(RestShape::Straight);
        }
        if hint.is_some() || twist != 0.0 {
            spec.frames = frames(&spec.centerline, hint, twist);
        }
        self.threads.push(ThreadDef { name, spec, location: table.location(), knot });
    }

    fn thickness(&self, table: &Table<'d>) -> Option<f64> {
        let preset = table.get("size").and_then(|v| match presets::find_size(&v.text()?) {
            Ok(size) => Some(0.5 * size.diameter.value),
            Err(e) => {
                v.problem(e.to_string(), None);
                None
            }
        });
        let radius = positive(table, "radius", Dim::LENGTH);
        let diameter = positive(table, "diameter", Dim::LENGTH).map(|d| 0.5 * d);
        let found = radius.or(diameter).or(preset);
        if found.is_none() && !["size", "radius", "diameter"].iter().any(|k| table.has(k)) {
            table.problem("`size`, `diameter` or `radius` is missing", None);
        }
        found
    }

    fn material(&self, table: &Table<'d>) -> Option<Material> {
        let mut failed = false;
        let preset = table.get("material").and_then(|v| match presets::find_material(&v.text()?) {
            Ok(m) => Some(m),
            Err(e) => {
                v.problem(e.to_string(), None);
                failed = true;
                None
            }
        });
        let e = positive(table, "young_modulus", Dim::PRESSURE).or(preset.map(|p| p.young_modulus.value));
        let density = positive(table, "density", Dim::DENSITY).or(preset.map(|p| p.density.value));
        let nu = in_range(table, "poisson_ratio", Dim::NUMBER, -0.999_999, 0.5);
        let g = positive(table, "shear_modulus", Dim::PRESSURE);
        if nu.is_some() && g.is_some() {
            table.problem("`poisson_ratio` and `shear_modulus` exclude each other", None);
        }
        let bend_scale = in_range(table, "bend_scale", Dim::NUMBER, 1e-12, 1.0).or(preset.map(|p| p.bend_scale.value)).unwrap_or(1.0);
        let bend_damping = in_range(table, "bend_damping", Dim::TIME, 0.0, 1e6).or(preset.map(|p| p.bend_damping.value)).unwrap_or(0.0);
        let plasticity = table.get("plasticity").and_then(|v| {
            let t = v.table()?;
            let yield_curvature = t.need("yield_curvature", "a curvature (1/m)").and_then(|v| positive_value(&v, Dim::CURVATURE));
            let yield_twist = positive(&t, "yield_twist", Dim::CURVATURE);
            let hardening = in_range(&t, "hardening", Dim::NUMBER, 0.0, 0.999_999).unwrap_or(0.0);
            t.finish();
            let yield_curvature = yield_curvature?;
            Some(Plasticity { yield_curvature, yield_twist: yield_twist.unwrap_or(yield_curvature), hardening })
        });
        let (Some(young_modulus), Some(density)) = (e, density) else {
            if !failed && !table.has("young_modulus") {
                table.problem("`material` or `young_modulus` is missing", Some(format!("materials: {}", names_of_materials())));
            } else if !failed && !table.has("density") {
                table.problem("`density` is missing (or name a `material`)", None);
            }
            return None;
        };
        let shear = match (g, nu) {
            (Some(g), _) => Shear::Modulus(g),
            (None, Some(nu)) => Shear::Poisson(nu),
            (None, None) => Shear::Poisson(preset.map_or(0.4, |p| p.poisson_ratio.value)),
        };
        Some(Material { young_modulus, shear, density, bend_scale, bend_damping, plasticity })
    }

    /// The particles of a thread (or of a rest shape with a given number of elements).
    fn centerline(&self, table: &Table<'d>, given: Option<usize>) -> Option<Vec<DVec3>> {
        const SHAPES: [&str; 5] = ["line", "arc", "helix", "points", "path"];
        let elements = match given {
            Some(n) => Some(n),
            None => table.get("elements").and_then(|v| v.integer(1, MAX_ELEMENTS)).map(|n| n as usize),
        };
        let found: Vec<Value<'d>> = SHAPES.iter().filter_map(|k| table.get(k)).collect();
        let [shape] = found.as_slice() else {
            let message = if found.is_empty() { "the shape is missing" } else { "more than one shape is given" };
            table.problem(message, Some(format!("one of: {}", SHAPES.join(", "))));
            return None;
        };
        let curve = if table.has("line") {
            let t = shape.table()?;
            let from = t.need_vector("from", Dim::LENGTH);
            let to = match (t.get("to"), t.get("direction")) {
                (Some(to), None) => to.vector(Dim::LENGTH),
                (None, Some(d)) => {
                    let (d, length) = (d.direction(), t.need("length", "a length").and_then(|v| positive_value(&v, Dim::LENGTH)));
                    from.zip(d).zip(length).map(|((from, d), l)| from + d * l)
                }
                _ => {
                    t.problem("either `to`, or `direction` and `length`", None);
                    None
                }
            };
            t.finish();
            Curve::new(vec![Piece::Line { from: from?, to: to? }])
        } else if table.has("arc") {
            let t = shape.table()?;
            let (center, axis, start) =
                (t.need_vector("center", Dim::LENGTH), t.need("axis", "a direction").and_then(|v| v.direction()), t.need_vector("start", Dim::LENGTH));
            let angle = t.need_quantity("angle", Dim::ANGLE);
            t.finish();
            Curve::new(vec![curve::turn(start?, center?, axis?, angle?, 0.0)])
        } else if table.has("helix") {
            let t = shape.table()?;
            let (center, axis, start) =
                (t.need_vector("center", Dim::LENGTH), t.need("axis", "a direction").and_then(|v| v.direction()), t.need_vector("start", Dim::LENGTH));
            let (pitch, turns) = (t.need_quantity("pitch", Dim::LENGTH), t.get("turns").and_then(|v| v.quantity(Dim::NUMBER)));
            let length = positive(&t, "length", Dim::LENGTH);
            if turns.is_some() == length.is_some() {
                t.problem("either `turns` or `length` of the thread", None);
            }
            t.finish();
            let (center, axis, start, pitch) = (center?, axis?, start?, pitch?);
            let arm = start - center;
            let radius = (arm - axis * axis.dot(arm)).length();
            let turns = turns.or_else(|| length.map(|l| l / (std::f64::consts::TAU * radius).hypot(pitch)))?;
            Curve::new(vec![curve::helix(start, center, axis, turns, pitch)])
        } else if table.has("points") {
            let points = self.points(shape)?;
            // As they are, unless a number of elements is wanted.
            match elements {
                Some(n) if n + 1 != points.len() => Curve::through(&points),
                _ if points.len() < 2 => {
                    shape.problem("at least two points are wanted", None);
                    return None;
                }
                _ => return Some(points),
            }
        } else {
            self.path(shape)?
        };
        let Some(n) = elements else {
            if !table.has("elements") {
                table.problem("`elements` is missing: the number of elements", None);
            }
            return None;
        };
        let cut = curve.cut(n).filter(|p| p.iter().all(|x| x.is_finite()));
        if cut.is_none() {
            shape.problem("it has no length, or is too large", None);
        }
        cut
    }

    /// Points inline, or `{ file = "..", unit = "mm" }`.
    fn points(&self, value: &Value<'d>) -> Option<Vec<DVec3>> {
        if !value.is_table() {
            return value.array("an array of points, or { file = \"..\", unit = \"mm\" }")?.iter().map(|v| v.vector(Dim::LENGTH)).collect();
        }
        let t = value.table()?;
        let unit = file_unit(&t);
        let text = t.need("file", "a file with three numbers a line").and_then(|v| self.file(&v));
        t.finish();
        match curve::read_points(&text?, unit?) {
            Ok(points) => Some(points),
            Err(e) => {
                value.problem(e, None);
                None
            }
        }
    }

    /// Pieces one after the other: `from`, then `line_to`, `line_by`, `arc`.
    fn path(&self, value: &Value<'d>) -> Option<Curve> {
        let mut pieces = Vec::new();
        let mut here: Option<DVec3> = None;
        let mut fine = true;
        for (i, item) in value.array("an array of pieces, the first { from = [x, y, z] }")?.iter().enumerate() {
            let t = item.table()?;
            let to = if i == 0 {
                here = t.need_vector("from", Dim::LENGTH);
                t.finish();
                fine &= here.is_some();
                continue;
            } else if let Some(v) = t.get("line_to") {
                v.vector(Dim::LENGTH).zip(here).map(|(to, from)| Piece::Line { from, to })
            } else if let Some(v) = t.get("line_by") {
                v.vector(Dim::LENGTH).zip(here).map(|(by, from)| Piece::Line { from, to: from + by })
            } else if let Some(v) = t.get("arc") {
                let a = v.table()?;
                let (center, axis) = (a.need_vector("center", Dim::LENGTH), a.need("axis", "a direction").and_then(|v| v.direction()));
                let (angle, advance) = (a.need_quantity("angle", Dim::ANGLE), a.quantity_or("advance", Dim::LENGTH, 0.0));
                a.finish();
                center.zip(axis).zip(angle).zip(here).map(|(((center, axis), angle), start)| curve::turn(start, center, axis, angle, advance))
            } else {
                item.problem("a piece is one of: line_to, line_by, arc", None);
                None
            };
            t.finish();
            match to {
                Some(piece) => {
                    here = Some(piece.at(1.0));
                    pieces.push(piece);
                }
                None => fine = false,
            }
        }
        // A piece without length has no direction.
        pieces.retain(|p| p.length() > 0.0);
        fine.then(|| Curve::new(pieces))
    }

    fn rest(&self, value: &Value<'d>, n: usize) -> Option<RestShape> {
        if value.is_text() {
            return value.choice(&[("straight", RestShape::Straight), ("as_inserted", RestShape::AsInserted)]);
        }
        let t = value.table()?;
        let shaped = ["line", "arc", "helix", "points", "path"].iter().any(|k| t.has(k));
        if shaped {
            let points = self.centerline(&t, Some(n));
            let twist = t.quantity_or("twist", Dim::ANGLE, 0.0);
            let hint = t.vector("d1", Dim::NUMBER);
            t.finish();
            let points = points?;
            let q = frames(&points, hint, twist)?;
            let lengths: Vec<f64> = points.windows(2).map(|p| p[0].distance(p[1])).collect();
            let darboux = (1..n).map(|j| log((q[j - 1].conjugate() * q[j]).normalize()) / (0.5 * (lengths[j - 1] + lengths[j]))).collect();
            return Some(RestShape::Given { lengths: Some(lengths), darboux: Some(darboux) });
        }
        let curvature = match t.get("curvature") {
            Some(v) if v.is_array() => match v.quantities(Dim::CURVATURE, "two curvatures, about d1 and d2")?.as_slice() {
                [a, b] => Some((*a, *b)),
                _ => {
                    v.problem("wanted two curvatures, about d1 and d2", None);
                    None
                }
            },
            Some(v) => v.quantity(Dim::CURVATURE).map(|k| (k, 0.0)),
            None => Some((0.0, 0.0)),
        };
        let twist = t.quantity_or("twist", Dim::CURVATURE, 0.0);
        let length = positive(&t, "length", Dim::LENGTH);
        t.finish();
        let (k1, k2) = curvature?;
        Some(RestShape::Given { lengths: length.map(|l| vec![l / n as f64; n]), darboux: Some(vec![DVec3::new(k1, k2, twist); n.saturating_sub(1)]) })
    }

    // ---- shapes ----

    fn shape(&mut self, table: &Table<'d>) {
        let index = self.shapes.len();
        let name = table.need("name", "the name of the shape").and_then(|v| v.text()).map_or(format!("shape{index}"), |t| t.into_owned());
        let geometry = self.geometry(table);
        let position = table.vector("position", Dim::LENGTH).unwrap_or(DVec3::ZERO);
        let orientation = orientation(table, Some(DQuat::IDENTITY)).unwrap_or(DQuat::IDENTITY);
        let surface = self.surface(table, 1);
        // A stand-in for what was reported keeps the numbers of the following shapes right.
        let geometry = geometry.unwrap_or(Geometry::Sphere { radius: 1.0 });
        // Any shape may be moved or pushed by an action; one that never is stays where it is.
        let spec = ShapeSpec { geometry, pose: Pose::new(position, orientation), surface, motion: ShapeMotion::Driven };
        self.shapes.push(ShapeDef { name, spec, location: table.location() });
    }

    fn geometry(&self, table: &Table<'d>) -> Option<Geometry> {
        let kinds = [("plane", 0), ("sphere", 1), ("capsule", 2), ("cylinder", 3), ("box", 4), ("mesh", 5)];
        let kind = table.need("kind", "plane, sphere, capsule, cylinder, box or mesh")?.choice(&kinds)?;
        let length = |key: &str| table.need(key, "a length").and_then(|v| positive_value(&v, Dim::LENGTH));
        match kind {
            0 => Some(Geometry::Plane),
            1 => Some(Geometry::Sphere { radius: length("radius")? }),
            2 | 3 => {
                let (radius, half_length) = (length("radius"), length("length").map(|l| 0.5 * l));
                let (radius, half_length) = (radius?, half_length?);
                Some(if kind == 2 { Geometry::Capsule { radius, half_length } } else { Geometry::Cylinder { radius, half_length } })
            }
            4 => {
                let sides = table.need("sides", "three lengths")?;
                let half_sides = sides.vector(Dim::LENGTH)? * 0.5;
                if half_sides.min_element() <= 0.0 {
                    sides.problem("sides must be > 0", None);
                    return None;
                }
                Some(Geometry::Box { half_sides })
            }
            _ => {
                if let Some(file) = table.get("file") {
                    let unit = file_unit(table);
                    let text = self.file(&file)?;
                    return match curve::read_obj(&text, unit?) {
                        Ok((vertices, triangles)) => Some(Geometry::Mesh { vertices, triangles }),
                        Err(e) => {
                            file.problem(e, None);
                            None
                        }
                    };
                }
                let vertices: Option<Vec<DVec3>> = table
                    .need("vertices", "corners, or a `file`")
                    .and_then(|v| v.array("an array of corners")?.iter().map(|v| v.vector(Dim::LENGTH)).collect());
                let triangles: Option<Vec<[u32; 3]>> = table.need("triangles", "three corner numbers each, from 0").and_then(|v| {
                    v.array("an array of triangles")?
                        .iter()
                        .map(|v| {
                            let corners: Vec<u32> = v.array("three corner numbers")?.iter().filter_map(|c| c.integer(0, 1 << 30)).map(|c| c as u32).collect();
                            <[u32; 3]>::try_from(corners).ok().or_else(|| {
                                v.problem("a triangle has three corners", None);
                                None
                            })
                        })
                        .collect()
                });
                Some(Geometry::Mesh { vertices: vertices?, triangles: triangles? })
            }
        }
    }

    // ---- what happens ----

    fn phase(&mut self, table: &Table<'d>, index: usize) -> Option<Phase> {
        let name = table.text("name").map_or(format!("phase {}", index + 1), |t| t.into_owned());
        if self.phases.iter().filter(|p| **p == name).count() > 1
            && let Some(v) = table.get("name")
        {
            v.problem(format!("two phases are called `{name}`"), None);
        }
        let actions = table.tables("action").iter().filter_map(|t| self.action(t)).collect();
        let duration = positive(table, "duration", Dim::TIME);
        let condition = table.get("until").map(|v| self.condition(&v));
        let at_most = positive(table, "max_duration", Dim::TIME);
        let at_least = in_range(table, "min_duration", Dim::TIME, 0.0, 1e9).unwrap_or(0.0);
        let late =
            table.get("out_of_time").and_then(|v| v.choice(&[("stop", Late::Stop), ("fail", Late::Fail), ("accept", Late::Accept)])).unwrap_or(Late::Fail);
        let save = table.text("save").map(|t| t.into_owned());
        if let Some(file) = &save
            && (file.is_empty() || file.contains(['/', '\\']))
            && let Some(v) = table.get("save")
        {
            v.problem("a plain file name is wanted; it is put into the folder of the run", None);
        }
        let still = table.truth_or("still", false);
        let knots = match table.get("knot") {
            None => Vec::new(),
            Some(v) if v.is_truth() => {
                if v.truth() == Some(true) {
                    (0..self.threads.len()).collect()
                } else {
                    Vec::new()
                }
            }
            Some(v) if v.is_array() => v.array("names of threads")?.iter().filter_map(|v| self.find_thread(v)).collect(),
            Some(v) => self.find_thread(&v).into_iter().collect(),
        };
        if duration.is_some()
            && let Some(v) = table.get("until")
        {
            v.problem("`duration` and `until` exclude each other", Some("`max_duration` bounds `until`".into()));
        }
        table.finish();
        let end = match (duration, condition) {
            (Some(d), _) => End::After(d),
            (None, Some(c)) => End::When { condition: Some(c?), at_least, at_most: at_most.unwrap_or(DEFAULT_MAX_DURATION), late },
            (None, None) => End::When { condition: None, at_least, at_most: at_most.unwrap_or(DEFAULT_MAX_DURATION), late },
        };
        Some(Phase { name, actions, end, save, knots, still })
    }

    fn action(&mut self, table: &Table<'d>) -> Option<Step> {
        const VERBS: [&str; 11] = ["take", "let_go", "move", "rest", "push", "load", "unload", "mark", "gravity", "solver", "friction"];
        let found: Vec<(&str, Value<'d>)> = VERBS.iter().filter_map(|v| table.get(v).map(|value| (*v, value))).collect();
        let [(verb, value)] = found.as_slice() else {
            table.finish();
            let message = if found.is_empty() { "the action does nothing" } else { "one action at a time" };
            table.problem(message, Some(format!("one of: {}", VERBS.join(", "))));
            return None;
        };
        let action = match *verb {
            "take" => self.find_grip(value).and_then(|grip| self.take(table, grip, 0.02)),
            "let_go" => self.find_grip(value).map(|grip| Action::LetGo { grip }),
            "move" => self.find_mover(value).and_then(|what| Some(Action::Move { what, plan: self.plan(table)? })),
            "rest" => self.find_mover(value).map(|what| Action::Rest { what }),
            "push" => self.find_mover(value).and_then(|what| self.push(table, what)),
            "load" => self.find_load(value).and_then(|load| self.load(table, load)),
            "unload" => self.find_load(value).map(|load| Action::Unload { load }),
            "mark" => self.find_thread(value).map(|thread| Action::Mark { thread }),
            "gravity" => value.vector(Dim::ACCELERATION).map(|v| Action::Gravity { value: v, ramp: ramp(table, 0.0) }),
            "friction" => self.two_surfaces(value).zip(coefficients(table)).map(|((a, b), friction)| Action::Friction { a, b, friction }),
            _ => value.table().map(|t| {
                let has = |key: &str| t.has(key);
                let mut s = Settings::default();
                self.solver_numbers(&t, &mut s);
                let action = Action::Solver {
                    linear_damping: has("linear_damping").then_some(s.linear_damping),
                    angular_damping: has("angular_damping").then_some(s.angular_damping),
                    substep: has("substep").then_some(s.substep),
                    newton_max: has("newton_max").then_some(s.newton_max),
                    tolerance: has("tolerance").then_some(s.tolerance),
                };
                t.finish();
                action
            }),
        };
        table.finish();
        Some(Step { action: action?, location: table.location() })
    }

    fn take(&self, table: &Table<'d>, grip: usize, default_ramp: f64) -> Option<Action> {
        let thread = self.thread_of(table);
        let place = table.need("at", "start, end, middle, a length such as \"35 mm\", \"particle 3\" or \"element 3\"");
        let place = thread.zip(place).and_then(|(thread, v)| self.place(&v, thread));
        let hold = match table.get("hold") {
            Some(v) => v.choice(&[("pin", Hold::Pin), ("clamp", Hold::Clamp), ("jaw", Hold::Jaw)]),
            None => Some(Hold::Jaw),
        };
        let ramp = ramp(table, default_ramp);
        Some(Action::Take { grip, thread: thread?, place: place?, hold: hold?, ramp })
    }

    /// A grip of the beginning may be moved or pushed from the beginning.
    fn drive_keys(&self, table: &Table<'d>, what: Mover) -> Option<Action> {
        if table.has("keys") {
            return self.plan(table).map(|plan| Action::Move { what, plan });
        }
        if table.has("force") { self.push(table, what) } else { None }
    }

    fn place(&self, value: &Value<'d>, thread: usize) -> Option<Place> {
        let n = self.threads.get(thread)?.spec.centerline.len() - 1;
        let length: f64 = self.rest_length(thread);
        let at = if value.is_text() {
            let text = value.text()?;
            match text.as_ref() {
                "start" => At::Start,
                "end" => At::End,
                "middle" => At::Middle,
                _ => {
                    let number = |prefix: &str| text.strip_prefix(prefix).and_then(|rest| rest.trim().parse::<u32>().ok());
                    if let Some(i) = number("particle ") {
                        At::Particle(i)
                    } else if let Some(i) = number("element ") {
                        At::Element(i)
                    } else if text.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c)) {
                        At::Arc(value.quantity(Dim::LENGTH)?)
                    } else {
                        value.problem(
                            format!("\"{text}\" is not a place: start, end, middle, a length such as \"35 mm\", \"particle 3\" or \"element 3\""),
                            crate::error::nearest(&text, ["start", "end", "middle"]).map(|n| format!("did you mean \"{n}\"?")),
                        );
                        return None;
                    }
                }
            }
        } else {
            At::Arc(value.quantity(Dim::LENGTH)?)
        };
        let fits = match at {
            At::Particle(i) => i as usize <= n,
            At::Element(i) => (i as usize) < n,
            // A length as long as the thread may differ from the sum of its elements by rounding.
            At::Arc(s) => (0.0..=length * (1.0 + 1e-9)).contains(&s),
            _ => true,
        };
        if !fits {
            value.problem(format!("the thread has {n} elements, particles 0 to {n}, and is {length:.6} m long"), None);
            return None;
        }
        Some(engine_place(at, length))
    }
    fn rest_length(&self, thread: usize) -> f64 {
        let spec = &self.threads[thread].spec;
        match &spec.rest {
            RestShape::Given { lengths: Some(l), .. } => l.iter().sum(),
            _ => spec.centerline.windows(2).map(|p| p[0].distance(p[1])).sum(),
        }
    }

    fn push(&self, table: &Table<'d>, what: Mover) -> Option<Action> {
        let direction = table.need("direction", "a direction").and_then(|v| v.direction());
        let force = table.need("force", "a force").and_then(|v| in_range_value(&v, Dim::FORCE, 0.0, 1e9));
        let speed_limit = table.need("speed_limit", "a speed").and_then(|v| positive_value(&v, Dim::SPEED));
        Some(Action::Push { what, direction: direction?, force: force?, speed_limit: speed_limit? })
    }

    fn load(&self, table: &Table<'d>, load: usize) -> Option<Action> {
        let thread = self.thread_of(table);
        let ramp = ramp(table, 0.0);
        if let Some(v) = table.get("force_per_length") {
            let force_per_length = v.vector(Dim::STIFFNESS);
            return Some(Action::Load { load, thread: thread?, kind: LoadDef::Uniform { force_per_length: force_per_length? }, ramp });
        }
        let place = table.need("at", "where along the thread (or `force_per_length` for all of it)");
        let place = thread.zip(place).and_then(|(thread, v)| self.place(&v, thread));
        let kind = if let Some(v) = table.get("mass") {
            let mass = in_range_value(&v, Dim::MASS, 0.0, 1e9);
            let inertia = table.vector("inertia", Dim::INERTIA).unwrap_or(DVec3::ZERO);
            if inertia.min_element() < 0.0
                && let Some(v) = table.get("inertia")
            {
                v.problem("moments of inertia must be >= 0", None);
            }
            LoadDef::Mass { place: place?, mass: mass?, inertia }
        } else {
            let (force, torque) = (table.vector("force", Dim::FORCE), table.vector("torque", Dim::TORQUE));
            if force.is_none() && torque.is_none() && !table.has("force") && !table.has("torque") {
                table.problem("a load has one of: force, torque, mass, force_per_length", None);
            }
            LoadDef::Point { place: place?, force: force.unwrap_or(DVec3::ZERO), torque: torque.unwrap_or(DVec3::ZERO) }
        };
        Some(Action::Load { load, thread: thread?, kind, ramp })
    }

    fn plan(&self, table: &Table<'d>) -> Option<Plan> {
        let ease =
            table.get("path").and_then(|v| v.choice(&[("smooth", Ease::Smooth), ("linear", Ease::Linear), ("spline", Ease::Spline)])).unwrap_or(Ease::Smooth);
        let relative = match table.get("relative_to") {
            None => Some(Relative::World),
            Some(v) => match v.text()?.as_ref() {
                "world" => Some(Relative::World),
                "start" => Some(Relative::Start),
                "taken" => Some(Relative::Taken),
                _ => self.find(&v, "shape (or: world, start, taken)", |n| if let Named::Shape(i) = n { Some(Relative::Shape(i)) } else { None }),
            },
        };
        let along = match table.get("orientation") {
            None => None,
            Some(v) => v.choice(&[("keep", None), ("along", Some(1.0)), ("against", Some(-1.0))])?,
        };
        let speed = positive(table, "speed", Dim::SPEED);
        let keys_value = table.need("keys", "an array of keys such as { to = [0, 0, 0.01], duration = \"0.5 s\" }")?;
        let mut keys = Vec::new();
        let mut fine = true;
        let mut last_time = 0.0;
        for item in keys_value.array("an array of keys such as { to = [0, 0, 0.01], duration = \"0.5 s\" }")? {
            let t = item.table()?;
            let key = self.key(&t, speed);
            if let Some(Key { when: When::At(time), .. }) = key {
                if time <= last_time && !(keys.is_empty() && time == 0.0) {
                    item.problem("times of keys must increase", None);
                    fine = false;
                }
                last_time = time;
            }
            t.finish();
            match key {
                Some(key) => keys.push(key),
                None => fine = false,
            }
        }
        if keys.is_empty() && fine {
            keys_value.problem("at least one key is wanted", None);
            fine = false;
        }
        fine.then_some(())?;
        Some(Plan { keys, ease, relative: relative?, along })
    }

    fn key(&self, t: &Table<'d>, speed: Option<f64>) -> Option<Key> {
        let goals = ["to", "by", "around"].iter().filter(|k| t.has(k)).count();
        if goals > 1 {
            t.problem("one of: to, by, around", None);
        }
        let goal = if let Some(v) = t.get("to") {
            v.vector(Dim::LENGTH).map(Goal::To)
        } else if let Some(v) = t.get("by") {
            v.vector(Dim::LENGTH).map(Goal::By)
        } else if let Some(v) = t.get("around") {
            v.table().and_then(|a| {
                let (center, axis) = (a.need_vector("center", Dim::LENGTH), a.need("axis", "a direction").and_then(|v| v.direction()));
                let (angle, advance) = (a.need_quantity("angle", Dim::ANGLE), a.quantity_or("advance", Dim::LENGTH, 0.0));
                let carry = a.truth_or("carry", false);
                a.finish();
                Some(Goal::Around { center: center?, axis: axis?, angle: angle?, advance, carry })
            })
        } else {
            Some(Goal::Stay)
        };
        let turning = if let Some(v) = t.get("turn") {
            v.table().and_then(|a| {
                let (axis, angle) = (a.need("axis", "a direction").and_then(|v| v.direction()), a.need_quantity("angle", Dim::ANGLE));
                a.finish();
                Some(Turning::By(axis? * angle?))
            })
        } else if let Some(v) = t.get("point") {
            v.direction().map(Turning::Point)
        } else if t.has("orientation") {
            orientation(t, None).map(Turning::To)
        } else {
            Some(Turning::Keep)
        };
        let own_speed = positive(t, "speed", Dim::SPEED);
        let when = match (in_range(t, "time", Dim::TIME, 0.0, 1e9), in_range(t, "duration", Dim::TIME, 0.0, 1e9), own_speed.or(speed)) {
            (Some(time), None, _) => Some(When::At(time)),
            (None, Some(d), _) => Some(When::After(d)),
            (Some(_), Some(_), _) => {
                t.problem("`time` and `duration` exclude each other", None);
                None
            }
            (None, None, Some(v)) if goals > 0 => Some(When::Speed(v)),
            _ => {
                if !t.has("time") && !t.has("duration") {
                    t.problem("when is missing: `duration` after the key before, `time` from the start of the phase, or a `speed`", None);
                }
                None
            }
        };
        Some(Key { goal: goal?, turning: turning?, when: when? })
    }

    /// A grip must be taken before it is moved or let go, a load set before it is taken off. Grips of a saved state may hold or not.
    fn check_order(&self, initial: &[Step], phases: &[Phase], from_saved: bool) {
        let mut held = vec![if from_saved { None } else { Some(false) }; self.grips.len()];
        let mut loaded = vec![if from_saved { None } else { Some(false) }; self.loads.len()];
        for step in initial.iter().chain(phases.iter().flat_map(|p| &p.actions)) {
            let wrong = |message: String| self.doc.problem_at(&step.location, message);
            match &step.action {
                Action::Take { grip, .. } => {
                    if held[*grip] == Some(true) {
                        wrong(format!("`{}` already holds; let it go first", self.grips[*grip]));
                    }
                    held[*grip] = Some(true);
                }
                Action::LetGo { grip }
                | Action::Move { what: Mover::Grip(grip), .. }
                | Action::Rest { what: Mover::Grip(grip) }
                | Action::Push { what: Mover::Grip(grip), .. } => {
                    if held[*grip] == Some(false) {
                        wrong(format!("`{}` does not hold anything then", self.grips[*grip]));
                    }
                    if matches!(step.action, Action::LetGo { .. }) {
                        held[*grip] = Some(false);
                    }
                }
                Action::Load { load, .. } => loaded[*load] = Some(true),
                Action::Unload { load } => {
                    if loaded[*load] == Some(false) {
                        wrong(format!("`{}` is not set then", self.loads[*load]));
                    }
                    loaded[*load] = Some(false);
                }
                _ => {}
            }
        }
    }

    // ---- what is watched ----

    fn probes(&mut self, root: &Table<'d>) -> Vec<ProbeDef> {
        let mut out = Vec::new();
        for table in root.tables("probe") {
            let name = table.need("name", "the name of the probe").and_then(|v| self.checked_name(&v));
            let what = table.need("what", "an expression such as \"tension(left)\"").and_then(|v| {
                let e = self.expression(&v)?;
                if *e.kind() == Kind::Text {
                    v.problem("a probe is a number, several numbers or a condition", None);
                    return None;
                }
                Some(e)
            });
            let unit = what.as_ref().and_then(|e| unit_for(&table, e.kind()));
            let every = in_range(&table, "every", Dim::TIME, 0.0, 1e9).unwrap_or(0.0);
            if let (Some(name), Some(what)) = (name, what) {
                self.names.probes.push(what.kind().clone());
                if !self.names.add(&name, Named::Probe(out.len()))
                    && let Some(v) = table.get("name")
                {
                    v.problem(format!("the name `{name}` is taken"), None);
                }
                if name == "frame"
                    && let Some(v) = table.get("name")
                {
                    v.problem("`frame` is the name of the built-in series", None);
                }
                out.push(ProbeDef { name, what, unit, every });
            }
            table.finish();
        }
        out
    }

    fn profile(&mut self, table: &Table<'d>) -> Option<ProfileDef> {
        let name = table.need("name", "the name of the profile").and_then(|v| self.checked_name(&v));
        let thread = self.thread_of(table);
        let words: Vec<(&str, ProfileColumn)> = PROFILES.iter().map(|p| (p.0, *p)).collect();
        let what = table.need("what", "what to read along the thread, such as [\"position\", \"tension\"]").and_then(|v| {
            if v.is_text() {
                v.choice(&words).map(|p| vec![p])
            } else {
                v.array("names of what to read along the thread")?.iter().map(|v| v.choice(&words)).collect()
            }
        });
        let moment = self.moment(table);
        table.finish();
        Some(ProfileDef { name: name?, thread: thread?, what: what?, moment: moment.unwrap_or(Moment::End) })
    }

    /// `at = "2 s"`, `after = "phase"`, or the end.
    fn moment(&self, table: &Table<'d>) -> Option<Moment> {
        match (table.get("at"), table.get("after")) {
            (None, None) => None,
            (Some(v), None) => in_range_value(&v, Dim::TIME, 0.0, 1e12).map(Moment::Time),
            (None, Some(v)) => self.find_phase(&v).map(Moment::PhaseEnd),
            (Some(v), Some(_)) => {
                v.problem("`at` and `after` exclude each other", None);
                None
            }
        }
    }

    fn check(&mut self, table: &Table<'d>, index: usize) -> Option<CheckDef> {
        let that_value = table.need("that", "an expression, such as \"clearance() >= -0.05\"");
        let that = that_value.as_ref().and_then(|v| self.expression(v));
        let text = that_value.as_ref().and_then(|v| v.text()).unwrap_or_default();
        let name = table.text("name").map_or(format!("{} {}", index + 1, text), |t| t.into_owned());
        let span = self.span(table);
        let takes = [
            ("every", Take::Every),
            ("first", Take::First),
            ("last", Take::Last),
            ("max", Take::Max),
            ("min", Take::Min),
            ("mean", Take::Mean),
            ("change", Take::Change),
            ("range", Take::Range),
        ];
        let take = table.get("take").and_then(|v| v.choice(&takes));
        let wanted = that.as_ref().and_then(|e| self.wanted(table, e));
        table.finish();
        let (that, (wanted, words, unit)) = (that?, wanted?);
        let windowed = !matches!(span, Span::Once(_));
        if let Some(take) = take
            && !windowed
            && take != Take::Last
            && let Some(v) = table.get("take")
        {
            v.problem("`take` needs a span: `when = \"always\"`, `during`, or `from` and `to`", None);
        }
        if matches!(wanted, Wanted::True | Wanted::Text(_))
            && !matches!(take, None | Some(Take::Every | Take::First | Take::Last))
            && let Some(v) = table.get("take")
        {
            v.problem("conditions and texts have no greatest, least or mean", None);
        }
        Some(CheckDef { name, that, wanted, words, unit, span, take: take.unwrap_or(if windowed { Take::Every } else { Take::Last }) })
    }

    fn span(&self, table: &Table<'d>) -> Span {
        if let Some(v) = table.get("when") {
            return v.choice(&[("end", Span::Once(Moment::End)), ("always", Span::Window(0.0, f64::INFINITY))]).unwrap_or(Span::Once(Moment::End));
        }
        if let Some(v) = table.get("during") {
            return self.find_phase(&v).map_or(Span::Once(Moment::End), Span::During);
        }
        let (from, to) = (in_range(table, "from", Dim::TIME, 0.0, 1e12), in_range(table, "to", Dim::TIME, 0.0, 1e12));
        if from.is_some() || to.is_some() {
            let (from, to) = (from.unwrap_or(0.0), to.unwrap_or(f64::INFINITY));
            if to < from {
                table.problem("`to` is before `from`", None);
            }
            return Span::Window(from, to);
        }
        Span::Once(self.moment(table).unwrap_or(Moment::End))
    }

    /// What is wanted, in words, and the unit to show.
    fn wanted(&self, table: &Table<'d>, that: &Expr) -> Option<(Wanted, String, Option<(String, Unit)>)> {
        const KEYS: [&str; 4] = ["equals", "at_least", "at_most", "between"];
        let given: Vec<&str> = KEYS.iter().copied().filter(|k| table.has(k)).collect();
        let tolerance = table.get("tolerance");
        let dim = match that.kind() {
            Kind::Truth => {
                let Some(v) = table.get("equals").filter(|_| given == ["equals"]) else {
                    if !given.is_empty() {
                        table.problem("a condition holds or not: it takes no bounds", None);
                    }
                    return Some((Wanted::True, "true".into(), None));
                };
                return if v.truth()? { Some((Wanted::True, "true".into(), None)) } else { Some((Wanted::Text("false".into()), "false".into(), None)) };
            }
            Kind::Text => {
                let v = table.need("equals", "the text wanted")?;
                let text = v.text()?.into_owned();
                let names = sutura::knot::KnotType::NAMES;
                if text != "unknown" && !names.iter().any(|n| texts_match(n, &text)) {
                    v.problem(format!("no knot is called `{text}`"), suggest(&text, names));
                }
                return Some((Wanted::Text(text.clone()), text, None));
            }
            // A vector is judged by its length.
            Kind::Number(d) | Kind::Vector(d) => *d,
            Kind::Columns(_) => {
                table.problem("several numbers cannot be checked at once; pick one, for instance `wrench(left).fx`", None);
                return None;
            }
        };
        let unit = unit_for(table, that.kind());
        let shown = |key: &str| table.get(key).and_then(|v| if v.is_text() { v.text().map(|t| t.trim().to_owned()) } else { None });
        let in_unit = |value: f64| {
            let (scale, name) = unit.as_ref().map_or((1.0, dim.si_unit()), |(n, u)| (u.size, n.clone()));
            format!("{} {name}", value / scale).trim().to_owned()
        };
        let show = |key: &str, value: f64| shown(key).unwrap_or_else(|| in_unit(value));
        // The unit in which the bound is written is the one to show.
        let shown_unit = unit.clone().or_else(|| {
            let text = shown(given.first()?)?;
            let start = crate::units::number_length(&text);
            let name = text[start..].trim().to_owned();
            parse_unit(&name).ok().filter(|u| !name.is_empty() && dim.accepts(u.dim)).map(|u| (name, u))
        });
        let result = match given.as_slice() {
            ["equals"] => {
                let value = table.get("equals")?.quantity(dim)?;
                let v = tolerance.or_else(|| table.need("tolerance", "the difference allowed, such as \"0.1 mm\" or \"1 %\""))?;
                let (allowed, words) = allowed(&v, value, dim)?;
                (Wanted::Near(value, allowed), format!("{} ± {words}", show("equals", value)))
            }
            ["at_least"] => {
                let value = table.get("at_least")?.quantity(dim)?;
                (Wanted::Between(value, f64::INFINITY), format!(">= {}", show("at_least", value)))
            }
            ["at_most"] => {
                let value = table.get("at_most")?.quantity(dim)?;
                (Wanted::Between(f64::NEG_INFINITY, value), format!("<= {}", show("at_most", value)))
            }
            ["at_least", "at_most"] => {
                let (a, b) = (table.get("at_least")?.quantity(dim)?, table.get("at_most")?.quantity(dim)?);
                (Wanted::Between(a, b), format!("{} to {}", show("at_least", a), show("at_most", b)))
            }
            ["between"] => {
                let v = table.get("between")?;
                let pair = v.quantities(dim, "two numbers, the least and the greatest allowed")?;
                let [a, b] = pair.as_slice() else {
                    v.problem("wanted two numbers, the least and the greatest allowed", None);
                    return None;
                };
                (Wanted::Between(*a, *b), format!("{} to {}", in_unit(*a), in_unit(*b)))
            }
            _ => {
                let message = if given.is_empty() { "what is wanted is missing" } else { "these exclude each other" };
                table.problem(message, Some("one of: equals with tolerance, at_least, at_most, between; or a condition in `that`".into()));
                return None;
            }
        };
        Some((result.0, result.1, shown_unit))
    }
}

/// Size and words of a tolerance, absolute or in percent of what is wanted.
fn allowed(value: &Value<'_>, wanted: f64, dim: Dim) -> Option<(f64, String)> {
    if value.is_text() {
        let text = value.text()?;
        if let Some(percent) = text.trim().strip_suffix('%') {
            return match percent.trim().parse::<f64>() {
                Ok(p) if p.is_finite() && p >= 0.0 => Some((wanted.abs() * p / 100.0, text.trim().to_owned())),
                _ => {
                    value.problem(format!("\"{text}\" is not a percentage"), None);
                    None
                }
            };
        }
    }
    let allowed = in_range_value(value, dim, 0.0, f64::MAX)?;
    let words = if value.is_text() { value.text()?.trim().to_owned() } else { format!("{allowed} {}", dim.si_unit()).trim().to_owned() };
    Some((allowed, words))
}

/// The `unit` in which numbers of a kind are shown.
fn unit_for(table: &Table<'_>, kind: &Kind) -> Option<(String, Unit)> {
    let value = table.get("unit")?;
    let name = value.text()?.trim().to_owned();
    let unit = match parse_unit(&name) {
        Ok(unit) => unit,
        Err(e) => {
            value.problem(e, None);
            return None;
        }
    };
    let fits = match kind {
        Kind::Number(d) | Kind::Vector(d) => d.accepts(unit.dim) || d.same_kind(unit.dim),
        Kind::Columns(c) => c.iter().all(|(_, d)| d.same_kind(unit.dim)),
        Kind::Truth | Kind::Text => false,
    };
    if fits {
        return Some((name, unit));
    }
    value.problem(format!("`{name}` does not fit what is read"), None);
    None
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

fn names_of_materials() -> String {
    presets::materials().iter().map(|m| m.name).collect::<Vec<_>>().join(", ")
}

/// Frames along points, the first director nearest to `hint`, turned evenly by `twist` over the length.
fn frames(points: &[DVec3], hint: Option<DVec3>, twist: f64) -> Option<Vec<DQuat>> {
    let distinct = points.windows(2).all(|p| p[0].distance(p[1]) > 0.0);
    if !distinct {
        return None; // the engine names the two points
    }
    let bend = points.windows(3).map(|w| (w[1] - w[0]).normalize().cross((w[2] - w[1]).normalize())).find(|c| c.length() > 1e-6);
    let q = transported_frames(points, hint.or(bend).unwrap_or(DVec3::ZERO));
    let n = q.len() as f64;
    Some(q.iter().enumerate().map(|(i, q)| (*q * exp(DVec3::Z * (twist * (i as f64 + 0.5) / n))).normalize()).collect())
}

fn ramp(table: &Table<'_>, default: f64) -> f64 {
    in_range(table, "ramp", Dim::TIME, 0.0, 1e9).unwrap_or(default)
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
    value.problem(if to > 1e8 { format!("{v} must be at least {from}") } else { format!("{v} must be from {from} to {to}") }, None);
    None
}

fn in_range(table: &Table<'_>, key: &str, dim: Dim, from: f64, to: f64) -> Option<f64> {
    in_range_value(&table.get(key)?, dim, from, to)
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
