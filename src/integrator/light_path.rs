//! Light path expressions: which light a layer shows, said as a regular expression over the events of a path.
//!
//! The language is that of Open Shading Language ("Light path expressions", OSL wiki), from the camera to the light:
//! `C` camera, `<RD>` an event by type (`R` reflection, `T` transmission) and scattering (`D` diffuse, `G` glossy, `S` smooth, `s` straight),
//! `L` light, `O` emitting surface, `B` environment, which is a light too; `<L.'key'>` lights of the group `key`. `D`, `G`, `S`, `s` alone stand for
//! `<.D>` …, `R` and `T` for `<R.>`, `<T.>`, `.` for any event; `[..]` one of, `[^..]` none of, and `* + ? {n} {n,m} | ( )` as usual.
//!
//! An expression becomes a nondeterministic automaton (K. Thompson, "Regular expression search algorithm", CACM 11(6), 1968) with at
//! most 128 states, whose set of current states is one number. Where a surface scatters in several ways at once, a path is in several
//! sets with the share of light that belongs to each: layers that divide the events between them sum to the whole, sample by sample.

use crate::bsdf;

/// The most states of an automaton.
const MAX_STATES: usize = 128;
/// The most repetitions that `{n,m}` can ask for.
const MAX_REPEAT: usize = 32;

/// What happens on a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Event {
    /// [`kind`] bits: a dome is a light and the background.
    kinds: u8,
    /// [`scatter`] bit; none of what does not scatter.
    scatter: u8,
    /// Light group.
    group: Option<u32>,
}

mod kind {
    pub(super) const CAMERA: u8 = 1;
    pub(super) const REFLECTION: u8 = 2;
    pub(super) const TRANSMISSION: u8 = 4;
    pub(super) const LIGHT: u8 = 8;
    pub(super) const OBJECT: u8 = 16;
    pub(super) const BACKGROUND: u8 = 32;
    pub(super) const ANY: u8 = 63;
}

mod scatter {
    pub(super) const DIFFUSE: u8 = 1;
    pub(super) const GLOSSY: u8 = 2;
    pub(super) const SINGULAR: u8 = 4;
    pub(super) const STRAIGHT: u8 = 8;
    pub(super) const ANY: u8 = 15;
}

/// What sends the light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// A light with a place.
    Light,
    /// A dome or a distant light.
    Environment,
    /// A surface that emits.
    Surface,
}

impl Event {
    const CAMERA: Self = Self { kinds: kind::CAMERA, scatter: 0, group: None };

    /// Light from a source.
    pub fn emission(source: Source, group: Option<u32>) -> Self {
        let kinds = match source {
            Source::Light => kind::LIGHT,
            Source::Environment => kind::LIGHT | kind::BACKGROUND,
            Source::Surface => kind::OBJECT,
        };
        Self { kinds, scatter: 0, group }
    }

    /// What a surface does; `passes`: to its other side.
    pub fn scattering(event: bsdf::Event, passes: bool) -> Self {
        let scatter = match event {
            bsdf::Event::Diffuse => scatter::DIFFUSE,
            bsdf::Event::GlossyReflection | bsdf::Event::GlossyTransmission => scatter::GLOSSY,
            bsdf::Event::SpecularReflection | bsdf::Event::SpecularTransmission => scatter::SINGULAR,
            bsdf::Event::Straight => scatter::STRAIGHT,
        };
        Self { kinds: if passes { kind::TRANSMISSION } else { kind::REFLECTION }, scatter, group: None }
    }
}

/// A set of events.
#[derive(Clone, Debug, PartialEq)]
struct Symbol {
    atoms: Vec<Atom>,
    is_negated: bool,
}

#[derive(Clone, Debug, PartialEq)]
struct Atom {
    kinds: u8,
    /// 0: whatever scattering, or none.
    scatter: u8,
    /// The label, by its index among the expression's own.
    label: Option<usize>,
}

/// A compiled expression.
#[derive(Clone, Debug)]
pub struct Expression {
    /// Symbol and next state of each state; no symbol: the state is only left without an event.
    moves: Vec<Option<(Symbol, usize)>>,
    /// States reached from each state without an event, itself included.
    closures: Vec<u128>,
    accepting: usize,
    start: usize,
    labels: Vec<String>,
    /// Light group of each label, once the groups are known; `None`: no light is in it.
    groups: Vec<Option<u32>>,
}

/// The states that an expression is in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct States(u128);

impl States {
    /// Whether nothing that follows can match.
    pub fn is_dead(self) -> bool {
        self.0 == 0
    }
}

impl Expression {
    /// Reads an expression; says what is wrong with one that is none.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut parser = Parser { rest: text.trim(), whole: text, labels: Vec::new() };
        let node = parser.alternatives()?;
        if !parser.rest.is_empty() {
            return Err(parser.problem("is not understood"));
        }
        let mut builder = Builder { moves: Vec::new(), empty: Vec::new() };
        let accepting = builder.state()?;
        let start = builder.build(&node, accepting)?;
        let labels = parser.labels;
        let groups = vec![None; labels.len()];
        let closures = builder.closures();
        Ok(Self { moves: builder.moves, closures, accepting, start, labels, groups })
    }

    /// What an AOV that is a part of the beauty shows: its own expression, or that of its argument.
    pub fn of_aov(name: &str, argument: &str) -> Result<Self, String> {
        let quoted = |quote: char| format!("C.*<[LO].{quote}{argument}{quote}>");
        match name {
            "diffuse" => Self::parse("C<.D>.*[LOB]"),
            "reflection" => Self::parse("C<R[GS]>.*[LOB]"),
            "transmission" => Self::parse("C<T[GSs]>.*[LOB]"),
            "emission" => Self::parse("C[LOB]"),
            "light_group" if argument.is_empty() => Err("names no light group: light_group:NAME".to_owned()),
            "light_group" => Self::parse(&quoted(if argument.contains('\'') { '"' } else { '\'' })),
            "lpe" => Self::parse(argument),
            other => Err(format!("'{other}' is no part of the beauty")),
        }
    }

    /// The same expression with labels that mean these light groups.
    pub fn with_groups(mut self, names: &[String]) -> Self {
        let index = |label: &String| names.iter().position(|name| name == label).map(|i| i as u32);
        self.groups = self.labels.iter().map(index).collect();
        self
    }

    /// Labels of lights that it asks for.
    pub fn labels(&self) -> &[String] {
        &self.labels
    }

    /// At the camera.
    pub fn start(&self) -> States {
        self.step(States(self.closures[self.start]), &Event::CAMERA)
    }

    /// After another event.
    pub fn step(&self, states: States, event: &Event) -> States {
        let mut next = 0;
        let mut rest = states.0;
        while rest != 0 {
            let state = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            if let Some((symbol, to)) = &self.moves[state]
                && self.matches(symbol, event)
            {
                next |= self.closures[*to];
            }
        }
        States(next)
    }

    /// Whether the path so far matches.
    pub fn accepts(&self, states: States) -> bool {
        states.0 >> self.accepting & 1 == 1
    }

    fn matches(&self, symbol: &Symbol, event: &Event) -> bool {
        let is_one = symbol.atoms.iter().any(|atom| {
            atom.kinds & event.kinds != 0
                && (atom.scatter == 0 || atom.scatter & event.scatter != 0)
                && atom.label.is_none_or(|label| self.groups[label].is_some() && self.groups[label] == event.group)
        });
        is_one != symbol.is_negated
    }
}

enum Node {
    Symbol(Symbol),
    Sequence(Vec<Node>),
    Either(Vec<Node>),
    Repeat(Box<Node>, usize, Option<usize>),
}

struct Parser<'t> {
    rest: &'t str,
    whole: &'t str,
    labels: Vec<String>,
}

impl Parser<'_> {
    fn problem(&self, what: &str) -> String {
        match self.rest.chars().next() {
            Some(c) => format!("'{c}' at place {} {what}", self.whole.len() - self.rest.len() + 1),
            None => format!("ends where something must follow ({what})"),
        }
    }

    fn peek(&mut self) -> Option<char> {
        self.rest = self.rest.trim_start();
        self.rest.chars().next()
    }

    fn take(&mut self, c: char) -> bool {
        if self.peek() != Some(c) {
            return false;
        }
        self.rest = &self.rest[c.len_utf8()..];
        true
    }

    fn expect(&mut self, c: char) -> Result<(), String> {
        if self.take(c) { Ok(()) } else { Err(self.problem(&format!("stands where '{c}' must"))) }
    }

    fn alternatives(&mut self) -> Result<Node, String> {
        let mut all = vec![self.sequence()?];
        while self.take('|') {
            all.push(self.sequence()?);
        }
        Ok(Node::Either(all))
    }

    fn sequence(&mut self) -> Result<Node, String> {
        let mut all = Vec::new();
        while let Some(c) = self.peek() {
            if matches!(c, '|' | ')') {
                break;
            }
            let one = self.one()?;
            all.push(self.repeated(one)?);
        }
        if all.is_empty() { Err(self.problem("begins nothing")) } else { Ok(Node::Sequence(all)) }
    }

    fn repeated(&mut self, node: Node) -> Result<Node, String> {
        let (low, high) = if self.take('*') {
            (0, None)
        } else if self.take('+') {
            (1, None)
        } else if self.take('?') {
            (0, Some(1))
        } else if self.take('{') {
            let low = self.number()?;
            let high = if self.take(',') {
                if self.peek() == Some('}') { None } else { Some(self.number()?) }
            } else {
                Some(low)
            };
            self.expect('}')?;
            if high.is_some_and(|high| high < low) {
                return Err(self.problem("follows a range that ends before it begins"));
            }
            (low, high)
        } else {
            return Ok(node);
        };
        Ok(Node::Repeat(Box::new(node), low, high))
    }

    fn number(&mut self) -> Result<usize, String> {
        self.peek();
        let digits: &str =
            &self.rest[..self.rest.len() - self.rest.trim_start_matches(|c: char| c.is_ascii_digit()).len()];
        let number = digits.parse().ok().filter(|&n| n <= MAX_REPEAT);
        let number = number.ok_or_else(|| self.problem(&format!("is no number of repetitions up to {MAX_REPEAT}")))?;
        self.rest = &self.rest[digits.len()..];
        Ok(number)
    }

    fn one(&mut self) -> Result<Node, String> {
        if self.take('(') {
            let inner = self.alternatives()?;
            self.expect(')')?;
            return Ok(inner);
        }
        if self.take('[') {
            let is_negated = self.take('^');
            let mut atoms = Vec::new();
            while !self.take(']') {
                atoms.push(self.atom()?);
            }
            return Ok(Node::Symbol(Symbol { atoms, is_negated }));
        }
        Ok(Node::Symbol(Symbol { atoms: vec![self.atom()?], is_negated: false }))
    }

    fn atom(&mut self) -> Result<Atom, String> {
        let anything = Atom { kinds: kind::ANY, scatter: 0, label: None };
        if self.take('<') {
            let kinds = self.set(kinds_of, kind::ANY)?;
            let scatter = match self.peek() {
                Some('>') => 0,
                _ => self.set(scatter_of, 0)?,
            };
            let label = match self.peek() {
                Some('>') => None,
                _ => Some(self.label()?),
            };
            self.expect('>')?;
            return Ok(Atom { kinds, scatter, label });
        }
        let Some(c) = self.peek() else { return Err(self.problem("no event")) };
        let atom = match (c, kinds_of(c), scatter_of(c)) {
            ('.', ..) => anything,
            (_, Some(kinds), _) => Atom { kinds, ..anything },
            (_, None, Some(scatter)) => Atom { kinds: kind::REFLECTION | kind::TRANSMISSION, scatter, label: None },
            _ => return Err(self.problem("is no event: C R T D G S s L O B .")),
        };
        self.rest = &self.rest[c.len_utf8()..];
        Ok(atom)
    }

    /// One letter, `.`, or `[..]` of letters, within `< >`.
    fn set(&mut self, bits: impl Fn(char) -> Option<u8>, any: u8) -> Result<u8, String> {
        if self.take('.') {
            return Ok(any);
        }
        if self.take('[') {
            let is_negated = self.take('^');
            let mut all = 0;
            while !self.take(']') {
                all |= self.letter(&bits)?;
            }
            let whole = if any == kind::ANY { kind::ANY } else { scatter::ANY };
            return Ok(if is_negated { whole & !all } else { all });
        }
        self.letter(&bits)
    }

    fn letter(&mut self, bits: impl Fn(char) -> Option<u8>) -> Result<u8, String> {
        let found = self.peek().and_then(|c| Some((c, bits(c)?)));
        let Some((c, found)) = found else { return Err(self.problem("is no event here")) };
        self.rest = &self.rest[c.len_utf8()..];
        Ok(found)
    }

    fn label(&mut self) -> Result<usize, String> {
        let quote = self.peek().filter(|c| matches!(c, '\'' | '"'));
        let Some(quote) = quote else { return Err(self.problem("is no label in quotes")) };
        let after = &self.rest[1..];
        let Some(end) = after.find(quote) else { return Err(self.problem("begins a label that never ends")) };
        let label = after[..end].to_owned();
        self.rest = &after[end + 1..];
        let known = self.labels.iter().position(|other| *other == label);
        Ok(known.unwrap_or_else(|| {
            self.labels.push(label);
            self.labels.len() - 1
        }))
    }
}

fn kinds_of(c: char) -> Option<u8> {
    Some(match c {
        'C' => kind::CAMERA,
        'R' => kind::REFLECTION,
        'T' => kind::TRANSMISSION,
        'L' => kind::LIGHT,
        'O' => kind::OBJECT,
        'B' => kind::BACKGROUND,
        _ => return None,
    })
}

fn scatter_of(c: char) -> Option<u8> {
    Some(match c {
        'D' => scatter::DIFFUSE,
        'G' => scatter::GLOSSY,
        'S' => scatter::SINGULAR,
        's' => scatter::STRAIGHT,
        _ => return None,
    })
}

/// Puts states together from the end to the beginning.
struct Builder {
    moves: Vec<Option<(Symbol, usize)>>,
    empty: Vec<Vec<usize>>,
}

impl Builder {
    fn state(&mut self) -> Result<usize, String> {
        if self.moves.len() == MAX_STATES {
            return Err(format!("needs more than {MAX_STATES} states: write fewer repetitions"));
        }
        self.moves.push(None);
        self.empty.push(Vec::new());
        Ok(self.moves.len() - 1)
    }

    /// The state in which `node` begins that ends in `end`.
    fn build(&mut self, node: &Node, end: usize) -> Result<usize, String> {
        match node {
            Node::Symbol(symbol) => {
                let state = self.state()?;
                self.moves[state] = Some((symbol.clone(), end));
                Ok(state)
            }
            Node::Sequence(nodes) => nodes.iter().rev().try_fold(end, |end, node| self.build(node, end)),
            Node::Either(nodes) => {
                if let [node] = &nodes[..] {
                    return self.build(node, end);
                }
                let state = self.state()?;
                for node in nodes {
                    let begin = self.build(node, end)?;
                    self.empty[state].push(begin);
                }
                Ok(state)
            }
            Node::Repeat(node, low, high) => {
                let mut begin = match high {
                    None => {
                        let again = self.state()?;
                        let body = self.build(node, again)?;
                        self.empty[again].extend([body, end]);
                        again
                    }
                    Some(high) => {
                        let mut begin = end;
                        for _ in *low..*high {
                            let body = self.build(node, begin)?;
                            let optional = self.state()?;
                            self.empty[optional].extend([body, end]);
                            begin = optional;
                        }
                        begin
                    }
                };
                for _ in 0..*low {
                    begin = self.build(node, begin)?;
                }
                Ok(begin)
            }
        }
    }

    fn closures(&self) -> Vec<u128> {
        let closure = |state: usize| {
            let (mut reached, mut stack) = (1u128 << state, vec![state]);
            while let Some(state) = stack.pop() {
                for &next in &self.empty[state] {
                    if reached >> next & 1 == 0 {
                        reached |= 1 << next;
                        stack.push(next);
                    }
                }
            }
            reached
        };
        (0..self.moves.len()).map(closure).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Events by letters: `d`, `g` reflected diffuse and glossy, `t` refracted, `m` mirrored; `L`, `B`, `O`, `k` a light of the group key.
    fn accepts(expression: &str, path: &str) -> bool {
        let expression = Expression::parse(expression).unwrap().with_groups(&["rim".to_owned(), "key".to_owned()]);
        let mut states = expression.start();
        for c in path.chars() {
            let event = match c {
                'd' => Event::scattering(bsdf::Event::Diffuse, false),
                'g' => Event::scattering(bsdf::Event::GlossyReflection, false),
                't' => Event::scattering(bsdf::Event::SpecularTransmission, true),
                'm' => Event::scattering(bsdf::Event::SpecularReflection, false),
                's' => Event::scattering(bsdf::Event::Straight, true),
                'L' => Event::emission(Source::Light, Some(0)),
                'k' => Event::emission(Source::Light, Some(1)),
                'B' => Event::emission(Source::Environment, None),
                'O' => Event::emission(Source::Surface, None),
                other => panic!("{other}"),
            };
            states = expression.step(states, &event);
        }
        expression.accepts(states)
    }

    #[test]
    fn the_examples_of_the_language() {
        // Direct and indirect diffuse, as the wiki has them.
        assert!(accepts("CDL", "dL") && !accepts("CDL", "ddL") && !accepts("CDL", "gL"));
        assert!(accepts("CD+L", "ddL") && accepts("C<RD>D*L", "dL") && !accepts("CD+L", "L"));
        // Caustics.
        assert!(accepts("CDS+L", "dtmL") && !accepts("CDS+L", "dgL"));
        assert!(accepts("C<TS>+<RD>L", "ttdL") && !accepts("C<TS>+<RD>L", "tmdL"));
        assert!(accepts("C.*<L.'key'>", "tdk") && !accepts("C.*<L.'key'>", "tdL") && !accepts("C.*<L.'key'>", "B"));
        assert!(accepts("C[SG]*D(L|B)", "mgdB") && accepts("C[^D]+L", "tgL") && !accepts("C[^D]+L", "tdL"));
        assert!(accepts("CD{2}L", "ddL") && !accepts("CD{2}L", "dddL") && accepts("CD{1,3}L", "dddL"));
        assert!(!accepts("CD{1,3}L", "ddddL") && accepts("CD{2,}O", "ddddO") && accepts("C D? L", "L"));
        assert!(accepts("C<.[GS]>L", "gL") && accepts("C<[RT][^D]>L", "tL") && !accepts("C<[RT][^D]>L", "dL"));
        assert!(accepts("CsL", "sL") && accepts("C<Ts>L", "sL") && accepts("CT*L", "tsL"));
        // A dome is a light and the background.
        assert!(accepts("CL", "B") && accepts("CB", "B") && !accepts("CB", "L") && !accepts("CL", "O"));
    }

    #[test]
    fn a_partition_of_the_first_event_is_one_of_all_paths() {
        let parts = ["C<.D>.*[LOB]", "C<R[GS]>.*[LOB]", "C<T[GSs]>.*[LOB]", "C[LOB]"];
        let events = ["d", "g", "t", "m", "s"];
        let mut paths = vec![String::new()];
        for _ in 0..4 {
            let longer: Vec<String> =
                paths.iter().flat_map(|path| events.map(|event| format!("{path}{event}"))).collect();
            paths.extend(longer);
        }
        for path in paths.iter().flat_map(|path| ["L", "B", "O", "k"].map(|end| format!("{path}{end}"))) {
            assert_eq!(parts.iter().filter(|part| accepts(part, &path)).count(), 1, "{path}");
        }
    }

    #[test]
    fn what_is_no_expression_says_where() {
        for (text, part) in [
            ("CXL", "'X' at place 2"),
            ("C(DL", "where ')' must"),
            ("C<RDL", "place 5"),
            ("", "begins nothing"),
            ("C|", "begins nothing"),
            ("C<L.key>", "no label in quotes"),
            ("C<L.'key>", "never ends"),
            ("CD{5,2}L", "before it begins"),
            ("CD{99}L", "up to 32"),
            ("C)", "not understood"),
            ("C(D{32}){32}L", "more than 128"),
            ("C[D", "no event"),
        ] {
            let problem = Expression::parse(text).unwrap_err();
            assert!(problem.contains(part), "{text}: {problem}");
        }
    }
}
