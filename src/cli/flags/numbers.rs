//! Values of flags: orders, windows, times.

use crate::identify::Order;
use crate::log::is_sample_time;

/// Largest order that may be asked for: beyond it no recording says anything.
const LARGEST_ORDER: usize = 1000;

/// `auto`, `4`, `2,4,6` or `2..8` (both ends included).
pub(crate) fn order(text: &str) -> Result<Order, String> {
    if text == "auto" {
        return Ok(Order::Auto);
    }
    let help =
        "expected `auto`, a number such as `4`, a list such as `2,4,6`, or a range such as `2..8`";
    let number = |text: &str| {
        let order: usize = text.trim().parse().map_err(|_| help.to_owned())?;
        match order {
            0 => Err("a model has at least one state".to_owned()),
            1..=LARGEST_ORDER => Ok(order),
            _ => Err(format!("the largest order is {LARGEST_ORDER}")),
        }
    };
    let mut orders = Vec::new();
    for part in text.split(',') {
        match part.split_once("..") {
            Some((from, to)) => {
                let (from, to) = (number(from)?, number(to.strip_prefix('=').unwrap_or(to))?);
                if from > to {
                    return Err(format!("the range {part} is empty: write {to}..{from}"));
                }
                orders.extend(from..=to);
            }
            None => orders.push(number(part)?),
        }
    }
    orders.sort_unstable();
    orders.dedup();
    Ok(match orders.as_slice() {
        [one] => Order::Fixed(*one),
        _ => Order::Compare(orders),
    })
}

/// A window that is chosen or given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Window(pub(super) Option<usize>);

/// `auto` or a number of samples.
pub(super) fn window(text: &str) -> Result<Window, String> {
    if text == "auto" {
        return Ok(Window(None));
    }
    match text.parse() {
        Ok(0) => Err("a window has at least one sample".to_owned()),
        Ok(samples) => Ok(Window(Some(samples))),
        Err(_) => Err("expected `auto` or a number of samples".to_owned()),
    }
}

/// A positive number of seconds.
pub(crate) fn seconds(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|value: &f64| is_sample_time(*value))
        .ok_or_else(|| "expected a positive number of seconds, such as 0.01".to_owned())
}

/// A level of significance.
pub(crate) fn level(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|value: &f64| *value > 0.0 && *value < 0.5)
        .ok_or_else(|| "expected a probability between 0 and 0.5, such as 0.01".to_owned())
}

/// A frequency in rad/s, zero included.
pub(crate) fn frequency(text: &str) -> Result<f64, String> {
    text.trim()
        .parse()
        .ok()
        .filter(|value: &f64| value.is_finite() && *value >= 0.0)
        .ok_or_else(|| "expected frequencies in rad/s, such as 0.1,0.3".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_are_lists_and_ranges() {
        assert_eq!(order("auto"), Ok(Order::Auto));
        assert_eq!(order("4"), Ok(Order::Fixed(4)));
        assert_eq!(order("6,2,4,2"), Ok(Order::Compare(vec![2, 4, 6])));
        assert_eq!(order("2..4"), Ok(Order::Compare(vec![2, 3, 4])));
        assert_eq!(order("2..=3,7"), Ok(Order::Compare(vec![2, 3, 7])));
        assert_eq!(order("3..3"), Ok(Order::Fixed(3)));
        for wrong in ["", "four", "0", "2,,3", "8..2", "-1", "2.5", "1..99999999"] {
            assert!(order(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn windows_and_times() {
        assert_eq!(window("auto"), Ok(Window(None)));
        assert_eq!(window("20"), Ok(Window(Some(20))));
        assert!(window("0").is_err() && window("x").is_err());
        assert_eq!(seconds("1e-3"), Ok(1e-3));
        assert!(seconds("0").is_err() && seconds("nan").is_err() && seconds("inf").is_err());
        assert_eq!(frequency("0"), Ok(0.0));
        assert!(frequency("-1").is_err());
    }
}
