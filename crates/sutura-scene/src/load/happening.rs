//! What happens: phases, actions, motions, loads.

use super::things::{reel_law, remake};
use super::*;

/// Longest time of a phase that ends by a condition, unless it says otherwise \[s\].
const DEFAULT_MAX_DURATION: f64 = 60.0;

impl<'d> Loader<'d> {
    pub(super) fn phase(&mut self, table: &Table<'d>, index: usize) -> Option<Phase> {
        let name = table.text("name").map_or(format!("phase {}", index + 1), std::borrow::Cow::into_owned);
        if self.phases.iter().filter(|p| **p == name).count() > 1
            && let Some(v) = table.get("name")
        {
            v.problem(format!("two phases are called `{name}`"), None);
        }
        let actions: Vec<Step> = table.tables("action").iter().filter_map(|t| self.action(t)).collect();
        let duration = positive(table, "duration", Dim::TIME);
        let condition = table.get("until").map(|v| self.condition(&v));
        let at_most = positive(table, "max_duration", Dim::TIME);
        let at_least = in_range(table, "min_duration", Dim::TIME, 0.0, 1e9).unwrap_or(0.0);
        let late = table
            .get("out_of_time")
            .and_then(|v| v.choice(&[("stop", Late::Stop), ("fail", Late::Fail), ("accept", Late::Accept)]))
            .unwrap_or(Late::Fail);
        let save = table.text("save").map(std::borrow::Cow::into_owned);
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
            Some(v) if v.is_array() => {
                v.array("names of threads")?.iter().filter_map(|v| self.find_thread(v)).collect()
            }
            Some(v) => self.find_thread(&v).into_iter().collect(),
        };
        if duration.is_some()
            && let Some(v) = table.get("until")
        {
            v.problem("`duration` and `until` exclude each other", Some("`max_duration` bounds `until`".into()));
        }
        table.finish();
        let takes_time = |step: &Step| match &step.action {
            Action::Move { .. } => true,
            Action::Load { ramp, .. } | Action::Gravity { ramp, .. } => *ramp > 0.0,
            _ => false,
        };
        if duration.is_none()
            && condition.is_none()
            && at_least == 0.0
            && !table.has("duration")
            && !actions.iter().any(takes_time)
        {
            table.problem(
                "when does it end? it has neither `duration`, `until`, nor a motion or ramp to wait for",
                None,
            );
        }
        let end = match (duration, condition) {
            (Some(d), _) => End::After(d),
            (None, Some(c)) => {
                End::When { condition: Some(c?), at_least, at_most: at_most.unwrap_or(DEFAULT_MAX_DURATION), late }
            }
            // Motions end by themselves.
            (None, None) => End::When { condition: None, at_least, at_most: at_most.unwrap_or(f64::INFINITY), late },
        };
        Some(Phase { name, actions, end, save, knots, still })
    }

    pub(super) fn action(&mut self, table: &Table<'d>) -> Option<Step> {
        const VERBS: [&str; 16] = [
            "take", "let_go", "move", "rest", "push", "grasp", "release", "load", "unload", "cut", "mark", "gravity",
            "solver", "friction", "material", "reel",
        ];
        let found: Vec<(&str, Value<'d>)> =
            VERBS.iter().filter_map(|v| table.get(v).map(|value| (*v, value))).collect();
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
            "push" => self.find_mover(value).and_then(|what| {
                if matches!(what, Mover::Body(_)) {
                    value.problem("a body is moved, held or free: it cannot be pushed", None);
                    return None;
                }
                self.push(table, what)
            }),
            "grasp" => {
                let by = table.need("by", "the body that holds it").and_then(|v| self.find_body(&v));
                self.find_body(value).zip(by).map(|(body, by)| Action::Hold { body, by })
            }
            "release" => self.find_body(value).map(|body| Action::Release { body }),
            "load" => self.find_load(value).and_then(|load| self.load(table, load)),
            "unload" => self.find_load(value).map(|load| Action::Unload { load }),
            "cut" => self.find_thread(value).and_then(|thread| self.cut(table, thread)),
            "mark" => self.find_thread(value).map(|thread| Action::Mark { thread }),
            "gravity" => value.vector(Dim::ACCELERATION).map(|v| Action::Gravity { value: v, ramp: ramp(table, 0.0) }),
            "reel" => self.find_reel(value).zip(reel_law(table)).map(|(reel, law)| Action::Reel { reel, law }),
            "material" => self.find_thread(value).map(|thread| Action::Remake { thread, change: remake(table) }),
            "friction" => self
                .two_surfaces(value)
                .zip(coefficients(table))
                .map(|((a, b), friction)| Action::Friction { a, b, friction }),
            _ => value.table().map(|t| {
                let has = |key: &str| t.has(key);
                let mut s = Settings::default();
                self.solver_numbers(&t, &mut s);
                let action = Action::Solver {
                    linear_damping: has("linear_damping").then_some(s.linear_damping),
                    angular_damping: has("angular_damping").then_some(s.angular_damping),
                    linear_drag: has("linear_drag").then_some(s.linear_drag),
                    angular_drag: has("angular_drag").then_some(s.angular_drag),
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

    /// The reel at the start or end of a thread, told as `\"thread.end\"`.
    fn find_reel(&self, value: &Value<'d>) -> Option<usize> {
        let text = value.text()?;
        let found = text.rsplit_once('.').and_then(|(thread, end)| {
            let at_end = [("start", false), ("end", true)].iter().find(|(name, _)| *name == end)?.1;
            self.reels.iter().position(|r| self.threads[r.thread].name == thread && r.at_end == at_end)
        });
        if found.is_none() {
            let all = self
                .reels
                .iter()
                .map(|r| format!("{}.{}", self.threads[r.thread].name, if r.at_end { "end" } else { "start" }));
            value.problem(
                format!("there is no reel at `{text}`"),
                Some(format!("reels: {}", all.collect::<Vec<_>>().join(", "))),
            );
        }
        found
    }

    pub(super) fn take(&self, table: &Table<'d>, grip: usize, default_ramp: f64) -> Option<Action> {
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
    pub(super) fn drive_keys(&self, table: &Table<'d>, what: Mover) -> Option<Action> {
        if table.has("keys") {
            return self.plan(table).map(|plan| Action::Move { what, plan });
        }
        if table.has("force") { self.push(table, what) } else { None }
    }

    pub(super) fn place(&self, value: &Value<'d>, thread: usize) -> Option<Place> {
        let lengths = &self.extents.get(thread)?.0;
        let (n, length): (usize, f64) = (lengths.len(), lengths.iter().sum());
        let at = if value.is_text() {
            let text = value.text()?;
            match text.as_ref() {
                "start" => At::Start,
                "end" => At::End,
                "middle" => At::Middle,
                _ => {
                    let number =
                        |prefix: &str| text.strip_prefix(prefix).and_then(|rest| rest.trim().parse::<u32>().ok());
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
    pub(super) fn push(&self, table: &Table<'d>, what: Mover) -> Option<Action> {
        let direction = table.need("direction", "a direction").and_then(|v| v.direction());
        let force = table.need("force", "a force").and_then(|v| in_range_value(&v, Dim::FORCE, 0.0, 1e9));
        let speed_limit = table.need("speed_limit", "a speed").and_then(|v| positive_value(&v, Dim::SPEED));
        Some(Action::Push { what, direction: direction?, force: force?, speed_limit: speed_limit? })
    }

    pub(super) fn load(&self, table: &Table<'d>, load: usize) -> Option<Action> {
        let thread = self.thread_of(table);
        let ramp = ramp(table, 0.0);
        if let Some(v) = table.get("force_per_length") {
            let force_per_length = v.vector(Dim::STIFFNESS);
            return Some(Action::Load {
                load,
                thread: thread?,
                kind: LoadDef::Uniform { force_per_length: force_per_length? },
                ramp,
            });
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

    pub(super) fn plan(&self, table: &Table<'d>) -> Option<Plan> {
        let ease = table
            .get("path")
            .and_then(|v| v.choice(&[("smooth", Ease::Smooth), ("linear", Ease::Linear), ("spline", Ease::Spline)]))
            .unwrap_or(Ease::Smooth);
        let relative = match table.get("relative_to") {
            None => Some(Relative::World),
            Some(v) => match v.text()?.as_ref() {
                "world" => Some(Relative::World),
                "start" => Some(Relative::Start),
                "taken" => Some(Relative::Taken),
                _ => self.find(&v, "shape (or: world, start, taken)", |n| {
                    if let Named::Shape(i) = n { Some(Relative::Shape(i)) } else { None }
                }),
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

    pub(super) fn key(&self, t: &Table<'d>, speed: Option<f64>) -> Option<Key> {
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
                let (center, axis) =
                    (a.need_vector("center", Dim::LENGTH), a.need("axis", "a direction").and_then(|v| v.direction()));
                let (angle, advance) =
                    (a.need_quantity("angle", Dim::ANGLE), a.quantity_or("advance", Dim::LENGTH, 0.0));
                let carry = a.truth_or("carry", false);
                a.finish();
                Some(Goal::Around { center: center?, axis: axis?, angle: angle?, advance, carry })
            })
        } else {
            Some(Goal::Stay)
        };
        let turning = if let Some(v) = t.get("turn") {
            v.table().and_then(|a| {
                let (axis, angle) =
                    (a.need("axis", "a direction").and_then(|v| v.direction()), a.need_quantity("angle", Dim::ANGLE));
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
        let when = match (
            in_range(t, "time", Dim::TIME, 0.0, 1e9),
            in_range(t, "duration", Dim::TIME, 0.0, 1e9),
            own_speed.or(speed),
        ) {
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

    /// A grip must be taken before it is moved or let go, a load set before it is taken off. Grips of a saved state may
    /// hold or not.
    pub(super) fn check_order(&self, initial: &[Step], phases: &[Phase], from_saved: bool) {
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
}

fn ramp(table: &Table<'_>, default: f64) -> f64 {
    in_range(table, "ramp", Dim::TIME, 0.0, 1e9).unwrap_or(default)
}
