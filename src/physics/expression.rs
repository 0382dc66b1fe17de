//! Expressions of a model: nodes in one arena, every operand before the operator that uses it.
//!
//! An arena in this order is walked without recursion, so that a text of any length or depth costs no stack.

/// Part of a text: bytes `start..end`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Span {
    /// First byte.
    pub start: usize,
    /// One past the last byte.
    pub end: usize,
}

/// A node of [`Expressions`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct ExpressionId(pub(crate) u32);

impl ExpressionId {
    /// Position in the arena.
    pub(crate) fn index(self) -> usize {
        self.0 as usize
    }
}

/// A variable of a [`ModelSpec`](super::ModelSpec): its position in the order of declaration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct VariableId(pub(crate) u32);

impl VariableId {
    /// Position in the order of declaration.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Functions of one argument.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs)]
pub(crate) enum Function {
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Sinh,
    Cosh,
    Tanh,
    Exp,
    Log,
    Log10,
    Sqrt,
    Abs,
    Sign,
}

/// Operators and functions of two arguments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs)]
pub(crate) enum Binary {
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    Min,
    Max,
    Atan2,
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
    Equal,
    NotEqual,
    And,
    Or,
}

/// One node. Conditions are numbers, 1 for true and 0 for false; only comparisons, `and`, `or` and `not` give them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Node {
    /// A literal.
    Number(f64),
    /// Time in seconds (in the unit of the recording's time axis).
    Time,
    /// Value of a variable.
    Variable(VariableId),
    /// Time derivative of a state.
    Derivative(VariableId),
    /// Value of a variable at the sample before: `pre(x)`.
    Previous(VariableId),
    /// `-a`
    Negate(ExpressionId),
    /// `not a`
    Not(ExpressionId),
    /// A function of one argument.
    Call(Function, ExpressionId),
    /// An operator or function of two arguments.
    Binary(Binary, ExpressionId, ExpressionId),
    /// `if condition then yes else no`
    If {
        /// 1 or 0.
        condition: ExpressionId,
        /// Value where the condition holds.
        yes: ExpressionId,
        /// Value elsewhere.
        no: ExpressionId,
    },
    /// `delay(value, time)`
    Delay {
        /// What is delayed.
        value: ExpressionId,
        /// By how long, seconds: parameters and numbers only.
        time: ExpressionId,
    },
}

impl Node {
    /// The nodes that this one uses.
    pub(crate) fn operands(&self) -> impl Iterator<Item = ExpressionId> {
        let (a, b, c) = match *self {
            Node::Number(_)
            | Node::Time
            | Node::Variable(_)
            | Node::Derivative(_)
            | Node::Previous(_) => (None, None, None),
            Node::Negate(a) | Node::Not(a) | Node::Call(_, a) => (Some(a), None, None),
            Node::Binary(_, a, b) => (Some(a), Some(b), None),
            Node::If { condition, yes, no } => (Some(condition), Some(yes), Some(no)),
            Node::Delay { value, time } => (Some(value), Some(time), None),
        };
        [a, b, c].into_iter().flatten()
    }
}

/// An arena of nodes; the operands of a node stand before it.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Expressions {
    nodes: Vec<Node>,
    spans: Vec<Span>,
}

impl Expressions {
    /// Appends a node, whose operands must be in the arena already.
    pub(crate) fn push(&mut self, node: Node, span: Span) -> ExpressionId {
        debug_assert!(node.operands().all(|o| o.index() < self.nodes.len()));
        self.nodes.push(node);
        self.spans.push(span);
        ExpressionId((self.nodes.len() - 1) as u32)
    }

    /// The node.
    pub(crate) fn node(&self, id: ExpressionId) -> Node {
        self.nodes[id.index()]
    }

    /// Where in the text the node stands.
    pub(crate) fn span(&self, id: ExpressionId) -> Span {
        self.spans[id.index()]
    }

    /// The variables of an expression, each once, in the order of the text.
    pub(crate) fn variables(&self, root: ExpressionId) -> Vec<VariableId> {
        let mut found = Vec::new();
        let mut waiting = vec![root];
        while let Some(id) = waiting.pop() {
            let node = self.node(id);
            if let Node::Variable(v) | Node::Previous(v) | Node::Derivative(v) = node
                && !found.contains(&v)
            {
                found.push(v);
            }
            let operands: Vec<ExpressionId> = node.operands().collect();
            waiting.extend(operands.into_iter().rev());
        }
        found
    }

    /// Whether an expression has a node of a kind.
    pub(crate) fn contains(&self, root: ExpressionId, is_one: &dyn Fn(Node) -> bool) -> bool {
        let node = self.node(root);
        is_one(node) || node.operands().any(|o| self.contains(o, is_one))
    }

    /// All nodes, in order.
    pub(crate) fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// Number of nodes.
    pub(crate) fn len(&self) -> usize {
        self.nodes.len()
    }

    /// True when a node is of that kind.
    pub(crate) fn any(&self, of_kind: impl Fn(&Node) -> bool) -> bool {
        self.nodes.iter().any(of_kind)
    }

    /// Removes every node behind the first `length`.
    pub(crate) fn truncate(&mut self, length: usize) {
        self.nodes.truncate(length);
        self.spans.truncate(length);
    }

    /// Changes nodes in place, in order; operands must stay before their operators.
    pub(crate) fn map(&mut self, mut change: impl FnMut(Node) -> Node) {
        for node in &mut self.nodes {
            *node = change(*node);
        }
    }
}
