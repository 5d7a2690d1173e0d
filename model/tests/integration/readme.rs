//! The README's table of disturbances shows the results of the simulated plant and the estimator.

const PAGE: &str = include_str!("../../README.md");

/// Cells of a Markdown table, row by row.
fn cells(table: &str) -> Vec<Vec<String>> {
    let row = |line: &str| {
        line.trim_matches('|')
            .split('|')
            .map(|c| c.trim().into())
            .collect()
    };
    table
        .lines()
        .filter(|line| line.starts_with('|'))
        .map(row)
        .collect()
}

/// The numbers in a cell such as "-0.30 % to +0.27 %".
fn numbers(cell: &str) -> Vec<f64> {
    cell.split(' ')
        .filter_map(|word| word.parse().ok())
        .collect()
}

#[test]
fn the_table_of_disturbances_is_current() {
    let (_, rest) = PAGE.split_once("<!-- disturbances -->").unwrap();
    let (page, _) = rest.split_once("<!-- /disturbances -->").unwrap();
    let (page, now) = (cells(page), cells(&crate::common::disturbances::table()));
    assert_eq!(page.len(), now.len());
    for (page, now) in page.iter().zip(&now) {
        assert_eq!(page[0], now[0]);
        for (page, now) in page.iter().zip(now).skip(1) {
            let (old, new) = (numbers(page), numbers(now));
            assert_eq!(old.len(), new.len(), "{page} {now}");
            // The last digit may differ between versions of libm.
            for (old, new) in old.iter().zip(&new) {
                assert!(
                    (old - new).abs() <= 0.011 + 1e-3 * new.abs(),
                    "{page} is now {now}"
                );
            }
        }
    }
}
