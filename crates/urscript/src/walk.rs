//! Everything in a tree, in its order.

use crate::tree::{Argument, Expression, ExpressionKind, Part, Statement, StatementKind};

/// What stands in a tree.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Node<'a> {
    Statement(&'a Statement),
    Expression(&'a Expression),
}

/// Visits all statements and expressions in some statements.
pub(crate) fn walk<'a>(statements: &'a [Statement], visit: &mut dyn FnMut(Node<'a>)) {
    for statement in statements {
        visit(Node::Statement(statement));
        match &statement.kind {
            StatementKind::Function(function) => {
                for value in function
                    .parameters
                    .iter()
                    .filter_map(|each| each.1.as_ref())
                {
                    expression(value, visit);
                }
                walk(&function.body, visit);
            }
            StatementKind::If {
                branches,
                otherwise,
            } => {
                for (condition, body) in branches {
                    expression(condition, visit);
                    walk(body, visit);
                }
                walk(otherwise, visit);
            }
            StatementKind::While { condition, body } => {
                expression(condition, visit);
                walk(body, visit);
            }
            StatementKind::Return(value) | StatementKind::Declare { value, .. } => {
                if let Some(value) = value {
                    expression(value, visit);
                }
            }
            StatementKind::Assign { target, value } => {
                for part in &target.parts {
                    if let Part::Element(indices) = part {
                        expressions(indices, visit);
                    }
                }
                expression(value, visit);
            }
            StatementKind::Kill(value)
            | StatementKind::Join(value)
            | StatementKind::Expression(value) => expression(value, visit),
            StatementKind::Break
            | StatementKind::Continue
            | StatementKind::Pass
            | StatementKind::Halt
            | StatementKind::EnterCritical
            | StatementKind::ExitCritical => {}
        }
    }
}

fn expressions<'a>(all: &'a [Expression], visit: &mut dyn FnMut(Node<'a>)) {
    for each in all {
        expression(each, visit);
    }
}

fn arguments<'a>(all: &'a [Argument], visit: &mut dyn FnMut(Node<'a>)) {
    for each in all {
        expression(&each.value, visit);
    }
}

fn expression<'a>(of: &'a Expression, visit: &mut dyn FnMut(Node<'a>)) {
    visit(Node::Expression(of));
    match &of.kind {
        ExpressionKind::Number(_)
        | ExpressionKind::Text(_)
        | ExpressionKind::Truth(_)
        | ExpressionKind::Name(_) => {}
        ExpressionKind::Call {
            arguments: given, ..
        }
        | ExpressionKind::Run {
            arguments: given, ..
        } => arguments(given, visit),
        ExpressionKind::Member {
            of,
            arguments: given,
            ..
        } => {
            expression(of, visit);
            arguments(given.as_deref().unwrap_or_default(), visit);
        }
        ExpressionKind::Element { of, indices } => {
            expression(of, visit);
            expressions(indices, visit);
        }
        ExpressionKind::Pose(parts) | ExpressionKind::List(parts) => expressions(parts, visit),
        ExpressionKind::Unary { operand, .. } => expression(operand, visit),
        ExpressionKind::Binary { left, right, .. } => {
            expression(left, visit);
            expression(right, visit);
        }
    }
}
