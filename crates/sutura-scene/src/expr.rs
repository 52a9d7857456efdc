//! The small language of conditions, probes and checks: numbers with units, places on threads, functions of the running world.
//!
//! Names, argument kinds and dimensions are checked when a scene is read, so that evaluation cannot fail; what is not there at the
//! moment (a grip that does not hold) is not-a-number, and no comparison with that is true.

use crate::error::suggest;
use crate::units::{Dim, Quantity, number_length, symbol};
use std::collections::BTreeMap;
use sutura::glam::DVec3;

/// Things of a scene that have names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Named {
    Thread(usize),
    Shape(usize),
    Grip(usize),
    Probe(usize),
}

/// The names of a scene.
#[derive(Debug, Clone, Default)]
pub struct Names {
    map: BTreeMap<String, Named>,
    /// What each probe gives, so that expressions may use it by name.
    pub probes: Vec<Kind>,
}

impl Names {
    pub fn get(&self, name: &str) -> Option<Named> {
        self.map.get(name).copied()
    }
    /// `false` when the name is taken.
    pub fn add(&mut self, name: &str, what: Named) -> bool {
        if self.map.contains_key(name) {
            return false;
        }
        self.map.insert(name.into(), what);
        true
    }
    /// All names that pass a filter.
    pub fn which(&self, keep: impl Fn(Named) -> bool) -> Vec<&str> {
        self.map.iter().filter(|(_, n)| keep(**n)).map(|(k, _)| k.as_str()).collect()
    }
}

/// Whether a word can be a name: letters, digits and `_`, beginning with a letter.
pub fn is_name(word: &str) -> bool {
    word.chars().next().is_some_and(|c| c.is_ascii_alphabetic()) && word.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// A place along a thread.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum At {
    Start,
    Middle,
    End,
    Particle(u32),
    Element(u32),
    /// Rest arc length from the start \[m\].
    Arc(f64),
}

/// An argument that names something.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Ref {
    Thread(usize),
    On(usize, At),
    Grip(usize),
    Shape(usize),
}

/// What an expression gives.
#[derive(Debug, Clone, PartialEq)]
pub enum Kind {
    Number(Dim),
    Vector(Dim),
    /// Several columns, each with its name and dimension.
    Columns(Vec<(&'static str, Dim)>),
    Truth,
    Text,
}

impl Kind {
    fn words(&self) -> String {
        match self {
            Kind::Number(d) => d.to_string(),
            Kind::Vector(d) => format!("a vector ({d})"),
            Kind::Columns(_) => "several numbers".into(),
            Kind::Truth => "true or false".into(),
            Kind::Text => "a text".into(),
        }
    }
}

/// A value in SI.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    Number(f64),
    Vector(DVec3),
    Columns(Vec<f64>),
    Truth(bool),
    Text(String),
}

/// Functions that read the running world.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Read {
    Time,
    PhaseTime,
    Position,
    Velocity,
    D1,
    D2,
    D3,
    Orientation,
    Tension,
    Shear,
    Moment,
    Bending,
    Torsion,
    Curvature,
    TwistRate,
    Force,
    Torque,
    Wrench,
    Distance,
    Gap,
    MinClearance,
    Clearance,
    ThreadClearance,
    ShapeClearance,
    Energy,
    Kinetic,
    Elastic,
    Elongation,
    Length,
    Twist,
    Writhe,
    Speed,
    Momentum,
    Contacts,
    Incidents,
    Done,
    Held,
    Knot,
    Determinant,
    Signature,
    Entries,
    Slip,
    PassesThrough,
}

/// Functions of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Maths {
    Abs,
    Sqrt,
    Sin,
    Cos,
    Exp,
    Ln,
    Atan2,
    Min,
    Max,
    Norm,
    Dot,
    Angle,
}

/// Kinds of thing that a function's argument may name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Wants {
    /// A place on a thread, a grip or a shape.
    Place,
    /// A place on a thread or a grip.
    OnThread,
    /// The same, or a thread for its greatest value.
    OnThreadOrAll,
    Thread,
    Grip,
    GripOrShape,
    ThreadOrShape,
}

const WRENCH: &[(&str, Dim)] = &[("fx", Dim::FORCE), ("fy", Dim::FORCE), ("fz", Dim::FORCE), ("mx", Dim::TORQUE), ("my", Dim::TORQUE), ("mz", Dim::TORQUE)];
const QUATERNION: &[(&str, Dim)] = &[("qx", Dim::NUMBER), ("qy", Dim::NUMBER), ("qz", Dim::NUMBER), ("qw", Dim::NUMBER)];
const ENTRIES: &[(&str, Dim)] = &[("tail_a", Dim::LENGTH), ("loop_a", Dim::LENGTH), ("loop_b", Dim::LENGTH), ("tail_b", Dim::LENGTH)];

struct Function {
    name: &'static str,
    read: Read,
    /// Each argument, and how many of them must be given.
    wants: &'static [Wants],
    least: usize,
    gives: Gives,
}

enum Gives {
    Number(Dim),
    Vector(Dim),
    Columns(&'static [(&'static str, Dim)]),
    Truth,
    Text,
}

const fn f(name: &'static str, read: Read, wants: &'static [Wants], least: usize, gives: Gives) -> Function {
    Function { name, read, wants, least, gives }
}

/// Every function that reads the world: the one list from which names, arguments and results are checked.
const FUNCTIONS: &[Function] = &[
    f("time", Read::Time, &[], 0, Gives::Number(Dim::TIME)),
    f("phase_time", Read::PhaseTime, &[], 0, Gives::Number(Dim::TIME)),
    f("position", Read::Position, &[Wants::Place], 1, Gives::Vector(Dim::LENGTH)),
    f("velocity", Read::Velocity, &[Wants::OnThread], 1, Gives::Vector(Dim::SPEED)),
    f("d1", Read::D1, &[Wants::Place], 1, Gives::Vector(Dim::NUMBER)),
    f("d2", Read::D2, &[Wants::Place], 1, Gives::Vector(Dim::NUMBER)),
    f("d3", Read::D3, &[Wants::Place], 1, Gives::Vector(Dim::NUMBER)),
    f("orientation", Read::Orientation, &[Wants::Place], 1, Gives::Columns(QUATERNION)),
    f("tension", Read::Tension, &[Wants::OnThreadOrAll], 1, Gives::Number(Dim::FORCE)),
    f("shear", Read::Shear, &[Wants::OnThreadOrAll], 1, Gives::Number(Dim::FORCE)),
    f("moment", Read::Moment, &[Wants::OnThread], 1, Gives::Vector(Dim::TORQUE)),
    f("bending", Read::Bending, &[Wants::OnThreadOrAll], 1, Gives::Number(Dim::TORQUE)),
    f("torsion", Read::Torsion, &[Wants::OnThreadOrAll], 1, Gives::Number(Dim::TORQUE)),
    f("curvature", Read::Curvature, &[Wants::OnThreadOrAll], 1, Gives::Number(Dim::CURVATURE)),
    f("twist_rate", Read::TwistRate, &[Wants::OnThread], 1, Gives::Number(Dim::CURVATURE)),
    f("force", Read::Force, &[Wants::GripOrShape], 1, Gives::Vector(Dim::FORCE)),
    f("torque", Read::Torque, &[Wants::GripOrShape], 1, Gives::Vector(Dim::TORQUE)),
    f("wrench", Read::Wrench, &[Wants::GripOrShape], 1, Gives::Columns(WRENCH)),
    f("distance", Read::Distance, &[Wants::Place, Wants::Place], 2, Gives::Number(Dim::LENGTH)),
    f("gap", Read::Gap, &[Wants::Thread, Wants::ThreadOrShape], 1, Gives::Number(Dim::LENGTH)),
    f("min_clearance", Read::MinClearance, &[], 0, Gives::Number(Dim::NUMBER)),
    f("clearance", Read::Clearance, &[], 0, Gives::Number(Dim::NUMBER)),
    f("thread_clearance", Read::ThreadClearance, &[], 0, Gives::Number(Dim::NUMBER)),
    f("shape_clearance", Read::ShapeClearance, &[], 0, Gives::Number(Dim::NUMBER)),
    f("energy", Read::Energy, &[Wants::Thread], 0, Gives::Number(Dim::TORQUE)),
    f("kinetic_energy", Read::Kinetic, &[Wants::Thread], 0, Gives::Number(Dim::TORQUE)),
    f("elastic_energy", Read::Elastic, &[Wants::Thread], 0, Gives::Number(Dim::TORQUE)),
    f("elongation", Read::Elongation, &[Wants::Thread], 0, Gives::Number(Dim::NUMBER)),
    f("length", Read::Length, &[Wants::Thread], 1, Gives::Number(Dim::LENGTH)),
    f("twist", Read::Twist, &[Wants::Thread], 1, Gives::Number(Dim::NUMBER)),
    f("writhe", Read::Writhe, &[Wants::Thread], 1, Gives::Number(Dim::NUMBER)),
    f("speed", Read::Speed, &[Wants::OnThreadOrAll], 0, Gives::Number(Dim::SPEED)),
    f("momentum", Read::Momentum, &[Wants::Thread], 0, Gives::Vector(Dim::MOMENTUM)),
    f("contacts", Read::Contacts, &[], 0, Gives::Number(Dim::NUMBER)),
    f("incidents", Read::Incidents, &[], 0, Gives::Number(Dim::NUMBER)),
    f("done", Read::Done, &[Wants::GripOrShape], 0, Gives::Truth),
    f("held", Read::Held, &[Wants::Grip], 1, Gives::Truth),
    f("knot", Read::Knot, &[Wants::Thread], 1, Gives::Text),
    f("determinant", Read::Determinant, &[Wants::Thread], 1, Gives::Number(Dim::NUMBER)),
    f("signature", Read::Signature, &[Wants::Thread], 1, Gives::Number(Dim::NUMBER)),
    f("entries", Read::Entries, &[Wants::Thread], 1, Gives::Columns(ENTRIES)),
    f("slip", Read::Slip, &[Wants::Thread], 1, Gives::Number(Dim::LENGTH)),
    f("passes_through", Read::PassesThrough, &[], 0, Gives::Truth),
];

const MATHS: &[(&str, Maths, usize)] = &[
    ("abs", Maths::Abs, 1),
    ("sqrt", Maths::Sqrt, 1),
    ("sin", Maths::Sin, 1),
    ("cos", Maths::Cos, 1),
    ("exp", Maths::Exp, 1),
    ("ln", Maths::Ln, 1),
    ("atan2", Maths::Atan2, 2),
    ("min", Maths::Min, 2),
    ("max", Maths::Max, 2),
    ("norm", Maths::Norm, 1),
    ("dot", Maths::Dot, 2),
    ("angle", Maths::Angle, 2),
];

/// Names of all functions, for the documentation test.
#[cfg(test)]
pub fn function_names() -> Vec<&'static str> {
    FUNCTIONS.iter().map(|f| f.name).chain(MATHS.iter().map(|m| m.0)).collect()
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Op {
    Add,
    Sub,
    Mul,
    Div,
    Eq,
    Ne,
    Lt,
    Le,
    Gt,
    Ge,
    And,
    Or,
}

#[derive(Debug, Clone, PartialEq)]
enum Node {
    Constant(Value),
    Read(Read, Vec<Ref>),
    Maths(Maths, Vec<Node>),
    Vector(Box<[Node; 3]>),
    Probe(usize),
    Pick(Box<Node>, usize),
    Negate(Box<Node>),
    Not(Box<Node>),
    Binary(Op, Box<Node>, Box<Node>),
}

/// A checked expression.
#[derive(Debug, Clone, PartialEq)]
pub struct Expr {
    node: Node,
    kind: Kind,
}

/// The running world, as expressions see it.
pub trait Live {
    fn read(&self, read: Read, args: &[Ref]) -> Value;
    fn probe(&self, probe: usize) -> Value;
}

impl Expr {
    /// Reads an expression. The error is a message and a suggestion.
    pub fn parse(text: &str, names: &Names) -> Result<Expr, (String, Option<String>)> {
        let tokens = lex(text)?;
        if tokens.len() > MAX_TOKENS {
            return Err((format!("the expression has {} words and marks, at most {MAX_TOKENS} are read", tokens.len()), None));
        }
        let mut parser = Parser { tokens, at: 0, names, depth: 0 };
        let (node, kind) = parser.or()?;
        match parser.peek() {
            None => Ok(Expr { node, kind }),
            Some(t) => Err((format!("`{t}` is not expected there in `{text}`"), None)),
        }
    }
    pub fn kind(&self) -> &Kind {
        &self.kind
    }
    pub fn value(&self, live: &dyn Live) -> Value {
        eval(&self.node, live)
    }
    /// Whether it holds (expressions of kind truth).
    pub fn holds(&self, live: &dyn Live) -> bool {
        self.value(live) == Value::Truth(true)
    }
}

fn number(value: &Value) -> f64 {
    match value {
        Value::Number(v) => *v,
        Value::Vector(v) => v.length(),
        _ => f64::NAN,
    }
}

fn vector(value: &Value) -> DVec3 {
    match value {
        Value::Vector(v) => *v,
        _ => DVec3::NAN,
    }
}

/// Whether a text is the one wanted. The name of a knot without its hand stands for both: `trefoil` for `trefoil-left`.
pub fn texts_match(found: &str, wanted: &str) -> bool {
    found == wanted || found.strip_suffix("-right").or(found.strip_suffix("-left")) == Some(wanted)
}

fn eval(node: &Node, live: &dyn Live) -> Value {
    match node {
        Node::Constant(v) => v.clone(),
        Node::Read(read, args) => live.read(*read, args),
        Node::Probe(i) => live.probe(*i),
        Node::Vector(parts) => Value::Vector(DVec3::from_array([0, 1, 2].map(|i| number(&eval(&parts[i], live))))),
        Node::Pick(inner, i) => Value::Number(match eval(inner, live) {
            Value::Vector(v) => v[*i],
            Value::Columns(c) => c.get(*i).copied().unwrap_or(f64::NAN),
            _ => f64::NAN,
        }),
        Node::Negate(inner) => match eval(inner, live) {
            Value::Vector(v) => Value::Vector(-v),
            other => Value::Number(-number(&other)),
        },
        Node::Not(inner) => Value::Truth(eval(inner, live) != Value::Truth(true)),
        Node::Maths(m, args) => {
            let v: Vec<Value> = args.iter().map(|a| eval(a, live)).collect();
            let n = |i: usize| number(&v[i]);
            Value::Number(match m {
                Maths::Abs => n(0).abs(),
                Maths::Sqrt => n(0).sqrt(),
                Maths::Sin => n(0).sin(),
                Maths::Cos => n(0).cos(),
                Maths::Exp => n(0).exp(),
                Maths::Ln => n(0).ln(),
                Maths::Atan2 => n(0).atan2(n(1)),
                Maths::Norm => n(0),
                // A missing value stays missing.
                Maths::Min if n(0).is_nan() || n(1).is_nan() => f64::NAN,
                Maths::Max if n(0).is_nan() || n(1).is_nan() => f64::NAN,
                Maths::Min => n(0).min(n(1)),
                Maths::Max => n(0).max(n(1)),
                Maths::Dot => vector(&v[0]).dot(vector(&v[1])),
                Maths::Angle => {
                    let (a, b) = (vector(&v[0]), vector(&v[1]));
                    a.cross(b).length().atan2(a.dot(b))
                }
            })
        }
        Node::Binary(op, a, b) => {
            let a = eval(a, live);
            // The right side of `and`, `or` may be dear (a knot): only when it matters.
            match op {
                Op::And if a != Value::Truth(true) => return Value::Truth(false),
                Op::Or if a == Value::Truth(true) => return Value::Truth(true),
                _ => {}
            }
            let b = eval(b, live);
            let (x, y) = (number(&a), number(&b));
            match op {
                Op::And | Op::Or => Value::Truth(b == Value::Truth(true)),
                Op::Add | Op::Sub if matches!(a, Value::Vector(_)) => {
                    let y = vector(&b);
                    Value::Vector(vector(&a) + if *op == Op::Add { y } else { -y })
                }
                Op::Add => Value::Number(x + y),
                Op::Sub => Value::Number(x - y),
                Op::Mul | Op::Div => match (&a, &b) {
                    (Value::Vector(v), _) => Value::Vector(if *op == Op::Mul { *v * y } else { *v / y }),
                    (_, Value::Vector(v)) => Value::Vector(*v * x),
                    _ => Value::Number(if *op == Op::Mul { x * y } else { x / y }),
                },
                Op::Eq | Op::Ne => {
                    let missing = matches!(&a, Value::Number(v) if v.is_nan()) || matches!(&b, Value::Number(v) if v.is_nan());
                    let same = match (&a, &b) {
                        (Value::Text(a), Value::Text(b)) => texts_match(a, b) || texts_match(b, a),
                        _ => a == b,
                    };
                    Value::Truth(!missing && same == (*op == Op::Eq))
                }
                Op::Lt => Value::Truth(x < y),
                Op::Le => Value::Truth(x <= y),
                Op::Gt => Value::Truth(x > y),
                Op::Ge => Value::Truth(x >= y),
            }
        }
    }
}

#[derive(Debug, Clone, PartialEq)]
enum Token {
    Quantity(Quantity, String),
    Word(String),
    Text(String),
    Mark(&'static str),
}

impl std::fmt::Display for Token {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Token::Quantity(_, t) | Token::Word(t) => write!(f, "{t}"),
            Token::Text(t) => write!(f, "'{t}'"),
            Token::Mark(m) => write!(f, "{m}"),
        }
    }
}

type Message = (String, Option<String>);

const MARKS: &[&str] = &["==", "!=", ">=", "<=", ">", "<", "+", "-", "*", "/", "(", ")", ",", ".", "[", "]"];

fn lex(text: &str) -> Result<Vec<Token>, Message> {
    let mut tokens = Vec::new();
    let mut rest = text.trim_start();
    while let Some(c) = rest.chars().next() {
        if c.is_ascii_digit() || (c == '.' && rest[1..].starts_with(|d: char| d.is_ascii_digit())) {
            let n = number_length(rest);
            let value: f64 = rest[..n].replace('_', "").parse().map_err(|_| (format!("`{}` is not a number", &rest[..n]), None))?;
            if !value.is_finite() {
                return Err((format!("`{}` is too large", &rest[..n]), None));
            }
            let (unit, used) = unit_after(&rest[n..]);
            let (value, dim) = (value * unit.0, unit.1);
            tokens.push(Token::Quantity(Quantity { value, dim }, rest[..n + used].trim().into()));
            rest = &rest[n + used..];
        } else if c.is_alphabetic() || c == '_' {
            let n = rest.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(rest.len());
            tokens.push(Token::Word(rest[..n].into()));
            rest = &rest[n..];
        } else if c == '\'' || c == '"' {
            let Some(n) = rest[1..].find(c) else { return Err((format!("the text `{rest}` has no closing quote"), None)) };
            tokens.push(Token::Text(rest[1..=n].into()));
            rest = &rest[n + 2..];
        } else if let Some(mark) = MARKS.iter().find(|m| rest.starts_with(**m)) {
            tokens.push(Token::Mark(mark));
            rest = &rest[mark.len()..];
        } else {
            let help = match c {
                '=' => Some("equality is `==`".into()),
                '&' | '|' | '!' => Some("write `and`, `or`, `not`".into()),
                _ => None,
            };
            return Err((format!("`{c}` is not expected in `{text}`"), help));
        }
        rest = rest.trim_start();
    }
    Ok(tokens)
}

/// The unit that follows a number: factors joined by spaces or `*`, `/` before a factor divides. Returns size, dimension and bytes used.
/// A word that is no unit ends it, so `2 N and ..` and `2 * x` read as expected.
fn unit_after(text: &str) -> ((f64, Dim), usize) {
    let (mut size, mut dim, mut used) = (1.0, Dim::NUMBER, 0);
    let mut first = true;
    loop {
        let rest = &text[used..];
        let trimmed = rest.trim_start();
        let mut at = rest.len() - trimmed.len();
        let (mut divide, mut piece) = (false, trimmed);
        if let Some(after) = trimmed.strip_prefix('/') {
            divide = true;
            piece = after.trim_start();
            at += trimmed.len() - piece.len();
        }
        if divide && first && at > 0 && !matches!(trimmed.as_bytes().get(1), Some(b'a'..=b'z' | b'A'..=b'Z')) {
            return ((size, dim), used);
        }
        let n = piece.find(|c: char| !(c.is_alphabetic() || c == '%' || c == '°')).unwrap_or(piece.len());
        // `2 x(..)` or `2 mm_` would not be units.
        let next = piece[n..].chars().next();
        let Some(unit) = symbol(&piece[..n]).filter(|_| !matches!(next, Some('(' | '_' | '0'..='9'))) else { return ((size, dim), used) };
        let mut power: i8 = if divide { -1 } else { 1 };
        let mut end = at + n;
        if let Some(digits) = piece[n..].strip_prefix('^') {
            let m = digits.find(|c: char| !(c.is_ascii_digit() || c == '-')).unwrap_or(digits.len());
            let Some(p) = digits[..m].parse::<i8>().ok().filter(|p| p.abs() <= 9) else { return ((size, dim), used) };
            power *= p;
            end += 1 + m;
        }
        size *= unit.size.powi(i32::from(power));
        dim = dim.times(unit.dim.power(power));
        used += end;
        first = false;
    }
}

struct Parser<'n> {
    tokens: Vec<Token>,
    at: usize,
    names: &'n Names,
    depth: u32,
}

type Parsed = Result<(Node, Kind), Message>;

/// Deeper nesting than this is refused, so that no text can exhaust the stack.
const MAX_DEPTH: u32 = 40;
/// A sum of many terms is a deep tree as well.
const MAX_TOKENS: usize = 1000;

impl Parser<'_> {
    fn peek(&self) -> Option<&Token> {
        self.tokens.get(self.at)
    }
    fn next(&mut self) -> Option<Token> {
        let t = self.tokens.get(self.at).cloned();
        self.at += 1;
        t
    }
    fn mark(&mut self, mark: &str) -> bool {
        let there = matches!(self.peek(), Some(Token::Mark(m)) if *m == mark);
        self.at += usize::from(there);
        there
    }
    fn word(&mut self, word: &str) -> bool {
        let there = matches!(self.peek(), Some(Token::Word(w)) if w == word);
        self.at += usize::from(there);
        there
    }
    fn expect(&mut self, mark: &'static str) -> Result<(), Message> {
        if self.mark(mark) {
            return Ok(());
        }
        match self.peek() {
            Some(t) => Err((format!("`{t}` stands where `{mark}` is expected"), None)),
            None => Err((format!("`{mark}` is missing at the end"), None)),
        }
    }

    fn or(&mut self) -> Parsed {
        self.depth += 1;
        if self.depth > MAX_DEPTH {
            return Err(("the expression is nested too deeply".into(), None));
        }
        let mut left = self.and()?;
        while self.word("or") {
            let right = self.and()?;
            left = logic(Op::Or, left, right)?;
        }
        self.depth -= 1;
        Ok(left)
    }
    fn and(&mut self) -> Parsed {
        let mut left = self.not()?;
        while self.word("and") {
            let right = self.not()?;
            left = logic(Op::And, left, right)?;
        }
        Ok(left)
    }
    fn not(&mut self) -> Parsed {
        let mut negations = 0;
        while self.word("not") {
            negations += 1;
        }
        let (mut node, kind) = self.comparison()?;
        if negations > 0 && kind != Kind::Truth {
            return Err((format!("`not` needs a condition, found {}", kind.words()), None));
        }
        if negations % 2 == 1 {
            node = Node::Not(Box::new(node));
        }
        Ok((node, kind))
    }
    fn comparison(&mut self) -> Parsed {
        let left = self.sum()?;
        let ops = [("==", Op::Eq), ("!=", Op::Ne), (">=", Op::Ge), ("<=", Op::Le), (">", Op::Gt), ("<", Op::Lt)];
        let Some((_, op)) = ops.iter().find(|(m, _)| self.mark(m)) else { return Ok(left) };
        let right = self.sum()?;
        let equality = matches!(op, Op::Eq | Op::Ne);
        let fine = match (&left.1, &right.1) {
            (Kind::Number(a) | Kind::Vector(a), Kind::Number(b)) | (Kind::Number(a), Kind::Vector(b)) => a.same_kind(*b),
            (Kind::Vector(a), Kind::Vector(b)) => equality && a.same_kind(*b),
            (Kind::Truth, Kind::Truth) | (Kind::Text, Kind::Text) => equality,
            _ => false,
        };
        if !fine {
            return Err((format!("{} cannot be compared with {}", left.1.words(), right.1.words()), None));
        }
        Ok((Node::Binary(*op, Box::new(left.0), Box::new(right.0)), Kind::Truth))
    }
    fn sum(&mut self) -> Parsed {
        let mut left = self.product()?;
        loop {
            let op = if self.mark("+") {
                Op::Add
            } else if self.mark("-") {
                Op::Sub
            } else {
                return Ok(left);
            };
            let right = self.product()?;
            let kind = match (&left.1, &right.1) {
                (Kind::Number(a), Kind::Number(b)) if a.same_kind(*b) => Kind::Number(*a),
                (Kind::Vector(a), Kind::Vector(b)) if a.same_kind(*b) => Kind::Vector(*a),
                (a, b) => return Err((format!("{} and {} cannot be added or subtracted", a.words(), b.words()), None)),
            };
            left = (Node::Binary(op, Box::new(left.0), Box::new(right.0)), kind);
        }
    }
    fn product(&mut self) -> Parsed {
        let mut left = self.unary()?;
        loop {
            let op = if self.mark("*") {
                Op::Mul
            } else if self.mark("/") {
                Op::Div
            } else {
                return Ok(left);
            };
            let right = self.unary()?;
            let combine = |a: Dim, b: Dim| if op == Op::Mul { a.times(b) } else { a.over(b) };
            let kind = match (&left.1, &right.1) {
                (Kind::Number(a), Kind::Number(b)) => Kind::Number(combine(*a, *b)),
                (Kind::Vector(a), Kind::Number(b)) => Kind::Vector(combine(*a, *b)),
                (Kind::Number(a), Kind::Vector(b)) if op == Op::Mul => Kind::Vector(combine(*a, *b)),
                (a, b) => return Err((format!("{} and {} cannot be multiplied or divided", a.words(), b.words()), None)),
            };
            left = (Node::Binary(op, Box::new(left.0), Box::new(right.0)), kind);
        }
    }
    fn unary(&mut self) -> Parsed {
        let mut minus = false;
        while self.mark("-") {
            minus = !minus;
        }
        let (node, kind) = self.postfix()?;
        if !minus {
            return Ok((node, kind));
        }
        match kind {
            Kind::Number(_) | Kind::Vector(_) => Ok((Node::Negate(Box::new(node)), kind)),
            _ => Err((format!("`-` needs a number, found {}", kind.words()), None)),
        }
    }
    fn postfix(&mut self) -> Parsed {
        let (mut node, mut kind) = self.primary()?;
        while self.mark(".") {
            let Some(Token::Word(part)) = self.next() else { return Err(("a component such as `x` is expected after `.`".into(), None)) };
            let (index, dim) = match &kind {
                Kind::Vector(d) => (["x", "y", "z"].iter().position(|p| *p == part), *d),
                Kind::Columns(c) => {
                    let i = c.iter().position(|(n, _)| *n == part);
                    (i, i.map_or(Dim::NUMBER, |i| c[i].1))
                }
                other => return Err((format!("{} has no component `{part}`", other.words()), None)),
            };
            let Some(index) = index else {
                let known: Vec<&str> = if let Kind::Columns(c) = &kind { c.iter().map(|(n, _)| *n).collect() } else { vec!["x", "y", "z"] };
                return Err((format!("there is no component `{part}`"), Some(format!("known: {}", known.join(", ")))));
            };
            node = Node::Pick(Box::new(node), index);
            kind = Kind::Number(dim);
        }
        Ok((node, kind))
    }
    fn primary(&mut self) -> Parsed {
        match self.next() {
            None => Err(("the expression ends too early".into(), None)),
            Some(Token::Quantity(q, _)) => Ok((Node::Constant(Value::Number(q.value)), Kind::Number(q.dim))),
            Some(Token::Text(t)) => Ok((Node::Constant(Value::Text(t)), Kind::Text)),
            Some(Token::Mark("(")) => {
                let inner = self.or()?;
                self.expect(")")?;
                Ok(inner)
            }
            Some(Token::Mark("[")) => self.vector_literal(),
            Some(Token::Word(w)) => match w.as_str() {
                "true" | "false" => Ok((Node::Constant(Value::Truth(w == "true")), Kind::Truth)),
                "pi" => Ok((Node::Constant(Value::Number(std::f64::consts::PI)), Kind::Number(Dim::NUMBER))),
                _ if self.mark("(") => self.call(&w),
                _ => self.named(&w),
            },
            Some(t) => Err((format!("`{t}` is not expected there"), None)),
        }
    }
    /// `[x, y, z] mm`, the unit read as a factor of each.
    fn vector_literal(&mut self) -> Parsed {
        let mut parts = Vec::new();
        let mut dim = None;
        for i in 0..3 {
            if i > 0 {
                self.expect(",")?;
            }
            let (node, kind) = self.sum()?;
            let Kind::Number(d) = kind else { return Err((format!("a vector is made of numbers, found {}", kind.words()), None)) };
            if *dim.get_or_insert(d) != d {
                return Err(("the components of a vector must have one dimension".into(), None));
            }
            parts.push(node);
        }
        self.expect("]")?;
        let mut dim = dim.unwrap_or_default();
        let mut size = 1.0;
        while let Some(unit) = match self.peek() {
            Some(Token::Word(w)) => symbol(w),
            _ => None,
        } {
            self.at += 1;
            size *= unit.size;
            dim = dim.times(unit.dim);
        }
        let scale = |n: Node| Node::Binary(Op::Mul, Box::new(n), Box::new(Node::Constant(Value::Number(size))));
        let Ok(parts) = <[Node; 3]>::try_from(parts) else { return Err(("a vector has three components".into(), None)) };
        Ok((Node::Vector(Box::new(parts.map(scale))), Kind::Vector(dim)))
    }
    fn named(&self, word: &str) -> Parsed {
        match self.names.get(word) {
            Some(Named::Probe(i)) => {
                let kind = self.names.probes.get(i).cloned().unwrap_or(Kind::Number(Dim::NUMBER));
                Ok((Node::Probe(i), kind))
            }
            Some(_) => Err((format!("`{word}` is a thing, not a value"), Some(format!("ask for something of it, for instance `position({word})`")))),
            None => {
                let functions: Vec<String> = FUNCTIONS.iter().filter(|f| f.least == 0).map(|f| format!("{}()", f.name)).collect();
                if FUNCTIONS.iter().any(|f| f.name == word) {
                    return Err((format!("`{word}` is a function"), Some(format!("write `{word}()` with its arguments"))));
                }
                let mut known: Vec<&str> = self.names.which(|n| matches!(n, Named::Probe(_)));
                known.extend(functions.iter().map(String::as_str));
                let near = crate::error::nearest(word, known).map(|n| format!("did you mean `{n}`?"));
                Err((format!("nothing is called `{word}`"), near))
            }
        }
    }
    fn call(&mut self, name: &str) -> Parsed {
        if let Some((_, maths, count)) = MATHS.iter().find(|(n, ..)| *n == name) {
            return self.maths(name, *maths, *count);
        }
        let Some(function) = FUNCTIONS.iter().find(|f| f.name == name) else {
            let known: Vec<&str> = FUNCTIONS.iter().map(|f| f.name).chain(MATHS.iter().map(|m| m.0)).collect();
            return Err((format!("there is no function `{name}`"), suggest(name, known)));
        };
        let mut args = Vec::new();
        while !self.mark(")") {
            if !args.is_empty() {
                self.expect(",")?;
            }
            let Some(wants) = function.wants.get(args.len()) else { return Err((format!("`{name}` takes {} argument(s)", function.wants.len()), None)) };
            args.push(self.reference(name, *wants)?);
        }
        if args.len() < function.least {
            return Err((format!("`{name}` needs {} argument(s), found {}", function.least, args.len()), None));
        }
        let kind = match &function.gives {
            Gives::Number(d) => Kind::Number(*d),
            Gives::Vector(d) => Kind::Vector(*d),
            Gives::Columns(c) => Kind::Columns(c.to_vec()),
            Gives::Truth => Kind::Truth,
            Gives::Text => Kind::Text,
        };
        Ok((Node::Read(function.read, args), kind))
    }
    fn maths(&mut self, name: &str, maths: Maths, count: usize) -> Parsed {
        let mut args = Vec::new();
        let mut kinds = Vec::new();
        while !self.mark(")") {
            if !args.is_empty() {
                self.expect(",")?;
            }
            let (node, kind) = self.or()?;
            args.push(node);
            kinds.push(kind);
        }
        if args.len() != count {
            return Err((format!("`{name}` takes {count} argument(s), found {}", args.len()), None));
        }
        let wrong = || Err((format!("`{name}` cannot take {}", kinds.iter().map(Kind::words).collect::<Vec<_>>().join(" and ")), None));
        let kind = match (maths, kinds.as_slice()) {
            (Maths::Abs, [Kind::Number(d)]) | (Maths::Norm, [Kind::Vector(d)]) => Kind::Number(*d),
            (Maths::Sin | Maths::Cos | Maths::Exp | Maths::Ln, [Kind::Number(d)]) if d.same_kind(Dim::NUMBER) => Kind::Number(Dim::NUMBER),
            (Maths::Sqrt, [Kind::Number(d)]) if d.m % 2 == 0 && d.kg % 2 == 0 && d.s % 2 == 0 => {
                Kind::Number(Dim { m: d.m / 2, kg: d.kg / 2, s: d.s / 2, rad: 0 })
            }
            (Maths::Min | Maths::Max, [Kind::Number(a), Kind::Number(b)]) if a.same_kind(*b) => Kind::Number(*a),
            (Maths::Atan2, [Kind::Number(a), Kind::Number(b)]) if a.same_kind(*b) => Kind::Number(Dim::ANGLE),
            (Maths::Dot, [Kind::Vector(a), Kind::Vector(b)]) => Kind::Number(a.times(*b)),
            (Maths::Angle, [Kind::Vector(_), Kind::Vector(_)]) => Kind::Number(Dim::ANGLE),
            _ => return wrong(),
        };
        Ok((Node::Maths(maths, args), kind))
    }
    /// An argument that names a thread, grip, shape, or a place on a thread: `silk.end`, `silk.particle[3]`, `silk[35 mm]`.
    fn reference(&mut self, function: &str, wants: Wants) -> Result<Ref, Message> {
        let Some(Token::Word(word)) = self.next() else { return Err((format!("`{function}` needs the name of a thing"), None)) };
        let reference = match self.names.get(&word) {
            Some(Named::Thread(t)) => self.place_on(t, &word)?,
            Some(Named::Grip(g)) => Ref::Grip(g),
            Some(Named::Shape(s)) => Ref::Shape(s),
            Some(_) => return Err((format!("`{word}` is neither a thread, a grip nor a shape"), None)),
            None => {
                let known = self.names.which(|n| matches!(n, Named::Thread(_) | Named::Grip(_) | Named::Shape(_)));
                return Err((format!("no thread, grip or shape is called `{word}`"), suggest(&word, known)));
            }
        };
        let fits = match (wants, reference) {
            (Wants::Place, r) => !matches!(r, Ref::Thread(_)),
            (Wants::OnThread, r) => matches!(r, Ref::On(..) | Ref::Grip(_)),
            (Wants::OnThreadOrAll, r) => matches!(r, Ref::On(..) | Ref::Grip(_) | Ref::Thread(_)),
            (Wants::Thread, r) => matches!(r, Ref::Thread(_)),
            (Wants::Grip, r) => matches!(r, Ref::Grip(_)),
            (Wants::GripOrShape, r) => matches!(r, Ref::Grip(_) | Ref::Shape(_)),
            (Wants::ThreadOrShape, r) => matches!(r, Ref::Thread(_) | Ref::Shape(_)),
        };
        if fits {
            return Ok(reference);
        }
        let wanted = match wants {
            Wants::Place => "a place such as `silk.end`, a grip or a shape",
            Wants::OnThread => "a place such as `silk.end`, or a grip",
            Wants::OnThreadOrAll => "a thread, a place such as `silk.end`, or a grip",
            Wants::Thread => "a thread",
            Wants::Grip => "a grip",
            Wants::GripOrShape => "a grip or a shape",
            Wants::ThreadOrShape => "a thread or a shape",
        };
        Err((format!("`{function}` wants {wanted}, `{word}` is not that"), None))
    }
    fn place_on(&mut self, thread: usize, name: &str) -> Result<Ref, Message> {
        if self.mark("[") {
            let arc = match self.next() {
                Some(Token::Quantity(q, _)) if Dim::LENGTH.accepts(q.dim) || q.dim == Dim::NUMBER => q.value,
                _ => return Err((format!("`{name}[..]` wants a length from the start, for instance `{name}[35 mm]`"), None)),
            };
            self.expect("]")?;
            return Ok(Ref::On(thread, At::Arc(arc)));
        }
        if !self.mark(".") {
            return Ok(Ref::Thread(thread));
        }
        let Some(Token::Word(part)) = self.next() else {
            return Err((format!("a place is expected after `{name}.`"), Some("start, middle, end, particle[3], element[3]".into())));
        };
        let at = match part.as_str() {
            "start" => At::Start,
            "middle" => At::Middle,
            "end" => At::End,
            "particle" | "element" => {
                self.expect("[")?;
                let index = match self.next() {
                    Some(Token::Quantity(q, _)) if q.dim == Dim::NUMBER && q.value.fract() == 0.0 && q.value < 1e9 => q.value as u32,
                    _ => return Err((format!("`{part}[..]` wants a whole number"), None)),
                };
                self.expect("]")?;
                if part == "particle" { At::Particle(index) } else { At::Element(index) }
            }
            other => return Err((format!("`{other}` is not a place on a thread"), suggest(other, ["start", "middle", "end", "particle", "element"]))),
        };
        Ok(Ref::On(thread, at))
    }
}

fn logic(op: Op, a: (Node, Kind), b: (Node, Kind)) -> Parsed {
    for kind in [&a.1, &b.1] {
        if *kind != Kind::Truth {
            return Err((format!("`and`, `or` join conditions, found {}", kind.words()), None));
        }
    }
    Ok((Node::Binary(op, Box::new(a.0), Box::new(b.0)), Kind::Truth))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A world in which every number is 2 and every vector (1, 2, 2).
    struct Two;
    impl Live for Two {
        fn read(&self, read: Read, args: &[Ref]) -> Value {
            match read {
                Read::Position | Read::Force => Value::Vector(DVec3::new(1.0, 2.0, 2.0)),
                Read::Knot => Value::Text("trefoil".into()),
                Read::Held => Value::Truth(true),
                Read::Wrench => Value::Columns(vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
                Read::Tension if args == [Ref::Grip(1)] => Value::Number(f64::NAN),
                _ => Value::Number(2.0),
            }
        }
        fn probe(&self, _: usize) -> Value {
            Value::Number(7.0)
        }
    }

    fn names() -> Names {
        let mut n = Names::default();
        n.add("silk", Named::Thread(0));
        n.add("left", Named::Grip(0));
        n.add("right", Named::Grip(1));
        n.add("post", Named::Shape(0));
        n.add("tip", Named::Probe(0));
        n.probes.push(Kind::Number(Dim::LENGTH));
        n
    }

    fn value(text: &str) -> Value {
        Expr::parse(text, &names()).unwrap_or_else(|e| panic!("{text}: {e:?}")).value(&Two)
    }

    #[test]
    fn precedence_units_and_functions() {
        for (text, wanted) in [
            ("1 + 2 * 3", 7.0),
            ("(1 + 2) * 3", 9.0),
            ("-2 * -3 - 1", 5.0),
            ("6 / 3 / 2", 1.0),
            ("2 mm * 3", 0.006),
            ("10 mN m / 2 m", 0.005),
            ("1 m/s * 3 s", 3.0),
            ("4 m/2", 2.0),
            ("sqrt(9 m^2)", 3.0),
            ("min(3, 2) + max(1 , abs(-5))", 7.0),
            ("norm(position(silk.end))", 3.0),
            ("norm(position(silk.end) - [1, 2, 0] m)", 2.0),
            ("position(silk.end).x", 1.0),
            ("wrench(left).mz", 6.0),
            ("dot(position(silk[35 mm]), position(post))", 9.0),
            ("tip * 2", 14.0),
            ("tension(left) / force(left).y", 1.0),
            ("angle([1,0,0], [0,1,0]) * 2", std::f64::consts::PI),
        ] {
            let Value::Number(v) = value(text) else { panic!("{text}") };
            assert!((v - wanted).abs() < 1e-12, "{text}: {v}");
        }
    }

    #[test]
    fn conditions() {
        for (text, wanted) in [
            ("tension(left) >= 2 N", true),
            ("tension(left) > 2000 mN", false),
            ("tension(left) >= 2 N and time() < 3 s", true),
            ("not (time() < 3 s) or held(left)", true),
            ("knot(silk) == 'trefoil'", true),
            ("knot(silk) != 'trefoil'", false),
            ("force(left) > 2.9 N", true),
            // A grip that does not hold has no tension, and nothing is true of it.
            ("tension(right) < 1 N", false),
            ("tension(right) >= 1 N", false),
            ("tension(right) == tension(right)", false),
            ("tension(right) != 1 N", false),
        ] {
            assert_eq!(value(text), Value::Truth(wanted), "{text}");
        }
    }

    #[test]
    fn mistakes_are_named() {
        for (text, part, help) in [
            ("tension(left) >= 2 mm", "a force cannot be compared with a length", ""),
            ("tension(lefft) >= 2 N", "`lefft`", "`left`"),
            ("tensoin(left) >= 2 N", "`tensoin`", "`tension`"),
            ("tension(left) = 2 N", "`=`", "=="),
            ("tension(left", "missing", ""),
            ("position(silk)", "wants a place", ""),
            ("position(silk.edn)", "`edn`", "`end`"),
            ("1 + position(silk.end)", "cannot be added", ""),
            ("1 m + 2 s", "cannot be added", ""),
            ("left > 2", "`left` is a thing", "position(left)"),
            ("1 and 2", "conditions", ""),
            ("tip.x", "component", ""),
            ("position(left).w", "`w`", "x, y, z"),
            ("'abc", "quote", ""),
            ("time", "function", "time()"),
            ("2 2", "not expected", ""),
            ("", "too early", ""),
        ] {
            let (message, hint) = Expr::parse(text, &names()).expect_err(text);
            assert!(message.contains(part), "{text}: {message}");
            assert!(hint.unwrap_or_default().contains(help), "{text}");
        }
    }

    #[test]
    fn every_function_is_documented() {
        let text = std::fs::read_to_string(std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/formats.md")).unwrap();
        for name in function_names() {
            assert!(text.contains(&format!("`{name}")) || text.contains(&format!(" {name} ")) || text.contains(&format!(" {name}`")), "{name}");
        }
    }

    #[test]
    fn deep_nesting_is_refused_not_overflowed() {
        let deep = "(".repeat(100_000) + "1" + &")".repeat(100_000);
        assert!(Expr::parse(&deep, &names()).is_err());
        assert!(Expr::parse(&("1 + ".repeat(100_000) + "1"), &names()).is_err());
        assert!(Expr::parse(&("-".repeat(900) + "1"), &names()).is_ok());
    }
}
