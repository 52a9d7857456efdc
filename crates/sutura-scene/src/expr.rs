//! The small language of conditions, probes and checks: numbers with units, places on threads, functions of the running
//! world.
//!
//! Names, argument kinds and dimensions are checked when a scene is read, so that evaluation cannot fail; what is not
//! there at the moment (a grip that does not hold) is not-a-number, and no comparison with that is true.

mod eval;
mod function;
mod lex;
mod parse;

pub use eval::texts_match;
pub use function::Read;

use crate::units::Dim;
use function::Maths;
use std::collections::BTreeMap;
use sutura::glam::DVec3;

/// Things of a scene that have names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Named {
    Thread(usize),
    Shape(usize),
    Body(usize),
    Joint(usize),
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
    word.chars().next().is_some_and(|c| c.is_ascii_alphabetic())
        && word.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
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
    Body(usize),
    Joint(usize),
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

/// A checked expression.
#[derive(Debug, Clone, PartialEq)]
pub struct Expr {
    node: Node,
    kind: Kind,
}

/// Its tree.
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

impl Node {
    fn probes(&self, found: &mut Vec<usize>) {
        match self {
            Node::Constant(_) | Node::Read(..) => {}
            Node::Probe(i) => {
                if !found.contains(i) {
                    found.push(*i);
                }
            }
            Node::Maths(_, nodes) => nodes.iter().for_each(|n| n.probes(found)),
            Node::Vector(nodes) => nodes.iter().for_each(|n| n.probes(found)),
            Node::Pick(inner, _) | Node::Negate(inner) | Node::Not(inner) => inner.probes(found),
            Node::Binary(_, a, b) => [a, b].iter().for_each(|n| n.probes(found)),
        }
    }
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

/// The running world, as expressions see it.
pub trait Live {
    fn read(&self, read: Read, args: &[Ref]) -> Value;
    fn probe(&self, probe: usize) -> Value;
}

impl Expr {
    /// Reads an expression. The error is a message and a suggestion.
    pub fn parse(text: &str, names: &Names) -> Result<Expr, (String, Option<String>)> {
        parse::parse(text, names)
    }
    pub fn kind(&self) -> &Kind {
        &self.kind
    }
    pub fn value(&self, live: &dyn Live) -> Value {
        eval::eval(&self.node, live)
    }
    /// What it reads, where it is one reading and nothing else.
    pub fn reads(&self) -> Option<Read> {
        match &self.node {
            Node::Read(read, _) => Some(*read),
            _ => None,
        }
    }
    /// Adds the probes that it names to those found, each once.
    pub fn probes(&self, found: &mut Vec<usize>) {
        self.node.probes(found);
    }
    /// Whether it holds (expressions of kind truth).
    pub fn holds(&self, live: &dyn Live) -> bool {
        self.value(live) == Value::Truth(true)
    }
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
        let text =
            std::fs::read_to_string(std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/formats.md"))
                .unwrap();
        for name in function::function_names() {
            assert!(
                text.contains(&format!("`{name}"))
                    || text.contains(&format!(" {name} "))
                    || text.contains(&format!(" {name}`")),
                "{name}"
            );
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
