//! A bar chart of values in characters, with steps of an eighth.

/// Blocks of zero to eight eighths.
const BLOCKS: [char; 9] = [' ', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// Lines of a chart, from the top, over values from zero to `greatest`; the newest is at the right.
pub(super) fn lines(values: &[f64], greatest: f64, rows: usize, columns: usize) -> Vec<String> {
    let first = values.len().saturating_sub(columns);
    let shown = values.get(first..).unwrap_or_default();
    let empty = columns.saturating_sub(shown.len());
    let eighths = |value: f64| {
        let part = if greatest > 0.0 {
            value / greatest
        } else {
            0.0
        };
        (part.clamp(0.0, 1.0) * (8 * rows) as f64).round() as usize
    };
    (0..rows)
        .rev()
        .map(|row| {
            let blocks = shown.iter().map(|&value| {
                let filled = eighths(value).saturating_sub(8 * row).min(8);
                BLOCKS.get(filled).copied().unwrap_or(' ')
            });
            std::iter::repeat_n(' ', empty).chain(blocks).collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_stand_as_high_as_they_are() {
        let lines = lines(&[9.0, 0.0, 0.5, 1.0, 2.0, 3.0], 2.0, 2, 7);
        assert_eq!(lines, ["  █   ██", "  █ ▄███"].map(|line| &line[1..]));
    }

    #[test]
    fn without_values_it_is_empty() {
        assert_eq!(lines(&[], 0.0, 2, 3), ["   ", "   "]);
    }
}
