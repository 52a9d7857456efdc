//! Probes, profiles and checks: what is read while a scene runs, and what is made of it.

use crate::expr::{Kind, Live, Value};
use crate::report::{CheckReport, CheckValue, ProbeReport, Series};
use crate::scene::{CheckDef, Moment, ProbeDef, ProfileDef, Span, Take, Wanted};
use crate::stage::{Stage, read_at_element};

/// A probe being read.
pub struct Probe {
    def: ProbeDef,
    series: Series,
    next: f64,
}

impl Probe {
    pub fn new(def: &ProbeDef) -> Self {
        let unit = |dim: crate::units::Dim| def.unit.as_ref().map_or(dim.si_unit(), |(n, _)| n.clone());
        let mut columns = vec![("time".to_owned(), "s".to_owned())];
        match def.what.kind() {
            Kind::Number(d) => columns.push((def.name.clone(), unit(*d))),
            Kind::Vector(d) => columns.extend(["x", "y", "z"].map(|n| (n.to_owned(), unit(*d)))),
            Kind::Columns(c) => columns.extend(c.iter().map(|(n, d)| ((*n).to_owned(), unit(*d)))),
            Kind::Truth | Kind::Text => columns.push((def.name.clone(), String::new())),
        }
        Probe { def: def.clone(), series: Series { name: def.name.clone(), columns, rows: Vec::new() }, next: 0.0 }
    }
    /// Its value in SI now, which goes into no series.
    pub fn value(&self, live: &dyn Live) -> Value {
        self.def.what.value(live)
    }
    /// Reads it when it is due; the value in SI is for expressions that name the probe.
    pub fn read(&mut self, live: &dyn Live, time: f64) -> Value {
        let value = self.value(live);
        // Times are sums of frames; half a microsecond early is due.
        if time + 5e-7 >= self.next {
            let scale = self.def.unit.as_ref().map_or(1.0, |(_, u)| u.size);
            let numbers = match &value {
                Value::Number(v) => vec![v / scale],
                Value::Vector(v) => v.to_array().map(|x| x / scale).to_vec(),
                Value::Columns(c) => c.iter().map(|x| x / scale).collect(),
                Value::Truth(b) => vec![f64::from(u8::from(*b))],
                Value::Text(_) => vec![f64::NAN],
            };
            self.series.rows.push(std::iter::once(time).chain(numbers).collect());
            if self.def.every > 0.0 {
                while self.next <= time + 5e-7 {
                    self.next += self.def.every;
                }
            }
        }
        value
    }
    pub fn finish(self) -> (Vec<ProbeReport>, Series) {
        let single = self.series.columns.len() == 2;
        let mut reports = Vec::new();
        for (c, (name, unit)) in self.series.columns.iter().enumerate().skip(1) {
            let values: Vec<f64> = self.series.rows.iter().map(|r| r[c]).filter(|v| v.is_finite()).collect();
            if let (Some(first), Some(last)) = (values.first(), values.last()) {
                reports.push(ProbeReport {
                    name: if single { self.def.name.clone() } else { format!("{}.{name}", self.def.name) },
                    unit: unit.clone(),
                    first: *first,
                    last: *last,
                    min: values.iter().copied().fold(f64::INFINITY, f64::min),
                    max: values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
                });
            }
        }
        (reports, self.series)
    }
}

/// Reads a profile along a thread: one row an element, at its middle.
pub fn profile(def: &ProfileDef, stage: &Stage) -> Series {
    let mut columns = vec![("arc".to_owned(), "m".to_owned())];
    for (_, _, names, unit) in &def.what {
        columns.extend(names.iter().map(|n| ((*n).to_owned(), (*unit).to_owned())));
    }
    let mut rows = Vec::new();
    if let Some(rod) = stage.rod(def.thread) {
        let mut arc = 0.0;
        for (j, l) in rod.rest_lengths().iter().enumerate() {
            let mut row = vec![arc + 0.5 * l];
            arc += l;
            for (_, read, ..) in &def.what {
                match read_at_element(stage, *read, def.thread, j) {
                    Value::Number(v) => row.push(v),
                    Value::Vector(v) => row.extend(v.to_array()),
                    _ => row.push(f64::NAN),
                }
            }
            rows.push(row);
        }
    }
    Series { name: def.name.clone(), columns, rows }
}

/// A check being made.
pub struct Check {
    def: CheckDef,
    /// Values seen: first, last, and the ones that decide.
    seen: Option<Seen>,
    count: u64,
    sum: f64,
    /// Times of the last value, and of the worst.
    last_time: f64,
    missing: bool,
}

struct Seen {
    first: Value,
    last: Value,
    min: f64,
    max: f64,
    worst: Value,
    worst_time: f64,
    badness: f64,
}

fn number(value: &Value) -> f64 {
    match value {
        Value::Number(v) => *v,
        Value::Vector(v) => v.length(),
        _ => f64::NAN,
    }
}

impl Check {
    pub fn new(def: &CheckDef) -> Self {
        Check { def: def.clone(), seen: None, count: 0, sum: 0.0, last_time: f64::NAN, missing: false }
    }
    /// How far a value is from passing; at most 0 passes.
    fn badness(&self, value: &Value) -> f64 {
        match &self.def.wanted {
            Wanted::True => f64::from(u8::from(*value != Value::Truth(true))),
            Wanted::Text(text) => {
                let same = match value {
                    Value::Text(t) => crate::expr::texts_match(t, text),
                    Value::Truth(b) => b.to_string() == *text,
                    _ => false,
                };
                f64::from(u8::from(!same))
            }
            Wanted::Near(wanted, allowed) => finite_or_bad((number(value) - wanted).abs() - allowed),
            Wanted::Between(a, b) => finite_or_bad((a - number(value)).max(number(value) - b)),
        }
    }
    /// Looks at the present state, a frame of a phase, when it is one of the check's.
    pub fn look(&mut self, live: &dyn Live, time: f64, phase: usize) {
        let due = match self.def.span {
            Span::Window(from, to) => time + 5e-7 >= from && time - 5e-7 <= to,
            Span::During(p) => p == phase,
            Span::Once(Moment::Time(t)) => self.count == 0 && time + 5e-7 >= t,
            Span::Once(_) => false,
        };
        if due {
            self.see(live, time);
        }
    }
    /// The end of a phase; `within` a frame, where nobody has looked yet at what is the last of the phase.
    pub fn phase_ended(&mut self, live: &dyn Live, time: f64, phase: usize, within: bool) {
        if self.def.span == Span::Once(Moment::PhaseEnd(phase)) || within && self.def.span == Span::During(phase) {
            self.see(live, time);
        }
    }
    /// The end of the run.
    pub fn run_ended(&mut self, live: &dyn Live, time: f64) {
        if self.def.span == Span::Once(Moment::End) {
            self.see(live, time);
        }
    }
    fn see(&mut self, live: &dyn Live, time: f64) {
        let value = self.def.that.value(live);
        let (badness, v) = (self.badness(&value), number(&value));
        self.count += 1;
        self.sum += v;
        self.last_time = time;
        self.missing |= matches!(value, Value::Number(_) | Value::Vector(_)) && v.is_nan();
        match &mut self.seen {
            None => {
                self.seen = Some(Seen {
                    first: value.clone(),
                    last: value.clone(),
                    min: v,
                    max: v,
                    worst: value,
                    worst_time: time,
                    badness,
                });
            }
            Some(seen) => {
                seen.min = seen.min.min(v);
                seen.max = seen.max.max(v);
                if badness > seen.badness {
                    (seen.worst, seen.worst_time, seen.badness) = (value.clone(), time, badness);
                }
                seen.last = value;
            }
        }
    }
    pub fn finish(self) -> CheckReport {
        let mut report = CheckReport {
            name: self.def.name.clone(),
            value: None,
            unit: String::new(),
            wanted: self.def.words.clone(),
            passed: false,
            time_s: None,
        };
        let Some(seen) = &self.seen else { return report };
        let (value, time) = match self.def.take {
            Take::Every => (seen.worst.clone(), seen.worst_time),
            Take::First => (seen.first.clone(), self.last_time),
            Take::Last => (seen.last.clone(), self.last_time),
            Take::Max => (Value::Number(seen.max), self.last_time),
            Take::Min => (Value::Number(seen.min), self.last_time),
            Take::Mean => (Value::Number(self.sum / self.count as f64), self.last_time),
            Take::Change => {
                let change = match (&seen.first, &seen.last) {
                    (Value::Vector(a), Value::Vector(b)) => Value::Vector(*b - *a),
                    (a, b) => Value::Number(number(b) - number(a)),
                };
                (change, self.last_time)
            }
            Take::Range => (Value::Number(seen.max - seen.min), self.last_time),
        };
        // Extremes pass over what is missing; they may not decide then.
        let decided = !(self.missing && matches!(self.def.take, Take::Max | Take::Min | Take::Range));
        report.passed = decided && self.badness(&value) <= 0.0;
        report.time_s = Some(time);
        let scale = self.def.unit.as_ref().map_or(1.0, |(_, u)| u.size);
        report.value = Some(match &value {
            Value::Truth(b) => CheckValue::Truth(*b),
            Value::Text(t) => CheckValue::Text(t.clone()),
            other => CheckValue::Number(number(other) / scale),
        });
        report.unit = match (&self.def.unit, self.def.that.kind()) {
            (Some((name, _)), _) => name.clone(),
            (None, Kind::Number(d) | Kind::Vector(d)) => d.si_unit(),
            _ => String::new(),
        };
        // JSON has no infinity; a value that is missing is no value.
        if matches!(report.value, Some(CheckValue::Number(v)) if !v.is_finite()) {
            report.value =
                Some(CheckValue::Text(if number(&value).is_nan() { "missing".into() } else { "far".into() }));
        }
        report
    }
}

/// A value that is missing never passes; infinitely far inside the bounds does.
fn finite_or_bad(badness: f64) -> f64 {
    if badness.is_nan() { f64::INFINITY } else { badness }
}
