//! What is watched: probes, profiles, checks.

use super::*;

/// What a profile can read: its name, how it is read, its columns and their SI unit.
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

/// What is wanted, in words, and the unit to show.
type Bound = (Wanted, String, Option<(String, Unit)>);

impl<'d> Loader<'d> {
    pub(super) fn probes(&mut self, root: &Table<'d>) -> Vec<ProbeDef> {
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

    pub(super) fn profile(&mut self, table: &Table<'d>) -> Option<ProfileDef> {
        let name = table.need("name", "the name of the profile").and_then(|v| self.checked_name(&v));
        // It is a series, as a probe is and what each frame was.
        if let Some(name) = &name
            && let Some(v) = table.get("name")
        {
            if name == "frame" || self.profiles.contains(name) || matches!(self.names.get(name), Some(Named::Probe(_)))
            {
                v.problem(format!("the name `{name}` is taken"), None);
            }
            self.profiles.push(name.clone());
        }
        let thread = self.thread_of(table);
        let words: Vec<(&str, ProfileColumn)> = PROFILES.iter().map(|p| (p.0, *p)).collect();
        let what =
            table.need("what", "what to read along the thread, such as [\"position\", \"tension\"]").and_then(|v| {
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
    pub(super) fn moment(&self, table: &Table<'d>) -> Option<Moment> {
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

    pub(super) fn check(&mut self, table: &Table<'d>, index: usize) -> Option<CheckDef> {
        let that_value = table.need("that", "an expression, such as \"clearance() >= -0.05\"");
        let that = that_value.as_ref().and_then(|v| self.expression(v));
        let text = that_value.as_ref().and_then(Value::text).unwrap_or_default();
        let name = table.text("name").map_or(format!("{} {}", index + 1, text), std::borrow::Cow::into_owned);
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
        Some(CheckDef {
            name,
            that,
            wanted,
            words,
            unit,
            span,
            take: take.unwrap_or(if windowed { Take::Every } else { Take::Last }),
        })
    }

    pub(super) fn span(&self, table: &Table<'d>) -> Span {
        if let Some(v) = table.get("when") {
            return v
                .choice(&[("end", Span::Once(Moment::End)), ("always", Span::Window(0.0, f64::INFINITY))])
                .unwrap_or(Span::Once(Moment::End));
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
    pub(super) fn wanted(&self, table: &Table<'d>, that: &Expr) -> Option<Bound> {
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
                return if v.truth()? {
                    Some((Wanted::True, "true".into(), None))
                } else {
                    Some((Wanted::Text("false".into()), "false".into(), None))
                };
            }
            Kind::Text => {
                let v = table.need("equals", "the text wanted")?;
                let text = v.text()?.into_owned();
                let (no_such, names) = match that.reads() {
                    Some(Read::Form) => ("no form of a knot", [&sutura::knot::Verdict::NAMES[..], &["none"]].concat()),
                    _ => ("no knot", [&sutura::knot::KnotType::NAMES[..], &["unnamed", "unknown"]].concat()),
                };
                if !names.iter().any(|n| texts_match(n, &text)) {
                    v.problem(format!("{no_such} is called `{text}`"), suggest(&text, names));
                }
                return Some((Wanted::Text(text.clone()), text, None));
            }
            // A vector is judged by its length.
            Kind::Number(d) | Kind::Vector(d) => *d,
            Kind::Columns(_) => {
                table.problem(
                    "several numbers cannot be checked at once; pick one, for instance `wrench(left).fx`",
                    None,
                );
                return None;
            }
        };
        let unit = unit_for(table, that.kind());
        let shown = |key: &str| {
            table.get(key).and_then(|v| if v.is_text() { v.text().map(|t| t.trim().to_owned()) } else { None })
        };
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
                let v = tolerance
                    .or_else(|| table.need("tolerance", "the difference allowed, such as \"0.1 mm\" or \"1 %\""))?;
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
                table.problem(
                    message,
                    Some("one of: equals with tolerance, at_least, at_most, between; or a condition in `that`".into()),
                );
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
    let words = if value.is_text() {
        value.text()?.trim().to_owned()
    } else {
        format!("{allowed} {}", dim.si_unit()).trim().to_owned()
    };
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
