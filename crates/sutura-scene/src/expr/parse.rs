//! Reads an expression: grammar, names, kinds and dimensions in one pass.

use super::function::{FUNCTIONS, Gives, MATHS, Maths, Wants};
use super::lex::{Message, Token, lex};
use super::{At, Expr, Kind, Named, Names, Node, Op, Ref, Value};
use crate::error::{nearest, suggest};
use crate::units::{Dim, symbol};

/// Deeper nesting than this is refused, so that no text can exhaust the stack.
const MAX_DEPTH: u32 = 40;
/// A sum of many terms is a deep tree as well.
const MAX_TOKENS: usize = 1000;

/// Reads an expression. The error is a message and a suggestion.
pub(super) fn parse(text: &str, names: &Names) -> Result<Expr, Message> {
    let tokens = lex(text)?;
    if tokens.len() > MAX_TOKENS {
        return Err((
            format!("the expression has {} words and marks, at most {MAX_TOKENS} are read", tokens.len()),
            None,
        ));
    }
    let mut parser = Parser { tokens, at: 0, names, depth: 0 };
    let (node, kind) = parser.or()?;
    match parser.peek() {
        None => Ok(Expr { node, kind }),
        Some(t) => Err((format!("`{t}` is not expected there in `{text}`"), None)),
    }
}

struct Parser<'n> {
    tokens: Vec<Token>,
    at: usize,
    names: &'n Names,
    depth: u32,
}

type Parsed = Result<(Node, Kind), Message>;

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
            (Kind::Number(a) | Kind::Vector(a), Kind::Number(b)) | (Kind::Number(a), Kind::Vector(b)) => {
                a.same_kind(*b)
            }
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
                (a, b) => {
                    return Err((format!("{} and {} cannot be multiplied or divided", a.words(), b.words()), None));
                }
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
            let Some(Token::Word(part)) = self.next() else {
                return Err(("a component such as `x` is expected after `.`".into(), None));
            };
            let (index, dim) = match &kind {
                Kind::Vector(d) => (["x", "y", "z"].iter().position(|p| *p == part), *d),
                Kind::Columns(c) => {
                    let i = c.iter().position(|(n, _)| *n == part);
                    (i, i.map_or(Dim::NUMBER, |i| c[i].1))
                }
                other => return Err((format!("{} has no component `{part}`", other.words()), None)),
            };
            let Some(index) = index else {
                let known: Vec<&str> = if let Kind::Columns(c) = &kind {
                    c.iter().map(|(n, _)| *n).collect()
                } else {
                    vec!["x", "y", "z"]
                };
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
            let Kind::Number(d) = kind else {
                return Err((format!("a vector is made of numbers, found {}", kind.words()), None));
            };
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
        let Ok(parts) = <[Node; 3]>::try_from(parts) else {
            return Err(("a vector has three components".into(), None));
        };
        Ok((Node::Vector(Box::new(parts.map(scale))), Kind::Vector(dim)))
    }
    fn named(&self, word: &str) -> Parsed {
        match self.names.get(word) {
            Some(Named::Probe(i)) => {
                let kind = self.names.probes.get(i).cloned().unwrap_or(Kind::Number(Dim::NUMBER));
                Ok((Node::Probe(i), kind))
            }
            Some(_) => Err((
                format!("`{word}` is a thing, not a value"),
                Some(format!("ask for something of it, for instance `position({word})`")),
            )),
            None => {
                let functions: Vec<String> =
                    FUNCTIONS.iter().filter(|f| f.least == 0).map(|f| format!("{}()", f.name)).collect();
                if FUNCTIONS.iter().any(|f| f.name == word) {
                    return Err((
                        format!("`{word}` is a function"),
                        Some(format!("write `{word}()` with its arguments")),
                    ));
                }
                let mut known: Vec<&str> = self.names.which(|n| matches!(n, Named::Probe(_)));
                known.extend(functions.iter().map(String::as_str));
                let near = nearest(word, known).map(|n| format!("did you mean `{n}`?"));
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
            let Some(wants) = function.wants.get(args.len()) else {
                return Err((format!("`{name}` takes {} argument(s)", function.wants.len()), None));
            };
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
        let wrong = || {
            Err((
                format!("`{name}` cannot take {}", kinds.iter().map(Kind::words).collect::<Vec<_>>().join(" and ")),
                None,
            ))
        };
        let kind = match (maths, kinds.as_slice()) {
            (Maths::Abs, [Kind::Number(d)]) | (Maths::Norm, [Kind::Vector(d)]) => Kind::Number(*d),
            (Maths::Sin | Maths::Cos | Maths::Exp | Maths::Ln, [Kind::Number(d)]) if d.same_kind(Dim::NUMBER) => {
                Kind::Number(Dim::NUMBER)
            }
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
    /// An argument that names a thread, grip, shape, body, or a place on a thread: `silk.end`, `silk.particle[3]`,
    /// `silk[35 mm]`.
    fn reference(&mut self, function: &str, wants: Wants) -> Result<Ref, Message> {
        let Some(Token::Word(mut word)) = self.next() else {
            return Err((format!("`{function}` needs the name of a thing"), None));
        };
        // A part of a thread may be named after it: `silk.cut`.
        while let (Some(Token::Mark(".")), Some(Token::Word(part))) = (self.peek(), self.tokens.get(self.at + 1)) {
            let name = format!("{word}.{part}");
            if self.names.get(&name).is_none() {
                break;
            }
            word = name;
            self.at += 2;
        }
        let reference = match self.names.get(&word) {
            Some(Named::Thread(t)) => self.place_on(t, &word)?,
            Some(Named::Grip(g)) => Ref::Grip(g),
            Some(Named::Shape(s)) => Ref::Shape(s),
            Some(Named::Body(b)) => Ref::Body(b),
            Some(Named::Joint(j)) => Ref::Joint(j),
            Some(_) => return Err((format!("`{word}` is neither a thread, a grip, a shape nor a body"), None)),
            None => {
                let known = self.names.which(|n| !matches!(n, Named::Probe(_)));
                return Err((format!("no thread, grip, shape or body is called `{word}`"), suggest(&word, known)));
            }
        };
        if wants.takes(reference) {
            return Ok(reference);
        }
        Err((format!("`{function}` wants {}, `{word}` is not that", wants.words()), None))
    }
    fn place_on(&mut self, thread: usize, name: &str) -> Result<Ref, Message> {
        if self.mark("[") {
            let arc = match self.next() {
                Some(Token::Quantity(q, _)) if Dim::LENGTH.accepts(q.dim) || q.dim == Dim::NUMBER => q.value,
                _ => {
                    return Err((
                        format!("`{name}[..]` wants a length from the start, for instance `{name}[35 mm]`"),
                        None,
                    ));
                }
            };
            self.expect("]")?;
            return Ok(Ref::On(thread, At::Arc(arc)));
        }
        if !self.mark(".") {
            return Ok(Ref::Thread(thread));
        }
        let Some(Token::Word(part)) = self.next() else {
            return Err((
                format!("a place is expected after `{name}.`"),
                Some("start, middle, end, particle[3], element[3]".into()),
            ));
        };
        let at = match part.as_str() {
            "start" => At::Start,
            "middle" => At::Middle,
            "end" => At::End,
            "particle" | "element" => {
                self.expect("[")?;
                let index = match self.next() {
                    Some(Token::Quantity(q, _)) if q.dim == Dim::NUMBER && q.value.fract() == 0.0 && q.value < 1e9 => {
                        q.value as u32
                    }
                    _ => return Err((format!("`{part}[..]` wants a whole number"), None)),
                };
                self.expect("]")?;
                if part == "particle" { At::Particle(index) } else { At::Element(index) }
            }
            other => {
                return Err((
                    format!("`{other}` is not a place on a thread"),
                    suggest(other, ["start", "middle", "end", "particle", "element"]),
                ));
            }
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
