//! Arithmetic in designs: `"1.64 + gap"`, with names from `[parameters]`.

use std::collections::BTreeMap;

/// Evaluates an expression of `+ - * /`, parentheses, numbers and names.
///
/// # Errors
/// A sentence that says what is wrong with the expression.
pub(super) fn evaluate(text: &str, names: &BTreeMap<String, f64>) -> Result<f64, String> {
    let mut parser = Parser {
        rest: text,
        names,
        depth: 0,
    };
    let value = parser.sum()?;
    match parser.peek() {
        None => Ok(value),
        Some(found) => Err(format!("{found:?} is unexpected in {text:?}")),
    }
}

/// Largest nesting depth of parentheses and signs, so that no text exhausts the stack.
const DEEPEST: u32 = 32;

struct Parser<'t> {
    rest: &'t str,
    names: &'t BTreeMap<String, f64>,
    depth: u32,
}

impl Parser<'_> {
    fn peek(&mut self) -> Option<char> {
        self.rest = self.rest.trim_start();
        self.rest.chars().next()
    }

    fn take(&mut self, wanted: char) -> bool {
        let found = self.peek() == Some(wanted);
        if found {
            self.rest = self.rest.get(wanted.len_utf8()..).unwrap_or("");
        }
        found
    }

    fn sum(&mut self) -> Result<f64, String> {
        let mut value = self.product()?;
        loop {
            if self.take('+') {
                value += self.product()?;
            } else if self.take('-') {
                value -= self.product()?;
            } else {
                return Ok(value);
            }
        }
    }

    fn product(&mut self) -> Result<f64, String> {
        let mut value = self.factor()?;
        loop {
            if self.take('*') {
                value *= self.factor()?;
            } else if self.take('/') {
                value /= self.factor()?;
            } else {
                return Ok(value);
            }
        }
    }

    fn factor(&mut self) -> Result<f64, String> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err(format!("nested more than {DEEPEST} deep"));
        }
        let value = if self.take('-') {
            -self.factor()?
        } else if self.take('(') {
            let value = self.sum()?;
            if !self.take(')') {
                return Err("a parenthesis is not closed".to_owned());
            }
            value
        } else {
            self.atom()?
        };
        self.depth -= 1;
        Ok(value)
    }

    fn atom(&mut self) -> Result<f64, String> {
        self.peek();
        let part = |c: char| c.is_alphanumeric() || c == '_' || c == '.';
        let length = self
            .rest
            .find(|c: char| !part(c))
            .unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(length);
        if word.is_empty() {
            return Err("a number or a name is missing".to_owned());
        }
        self.rest = rest;
        if let Some(value) = self.names.get(word) {
            return Ok(*value);
        }
        // Exponents with a sign are allowed in TOML's own numbers only; "inf" and "nan" are not
        // accepted as numbers.
        let number = word.starts_with(|c: char| c.is_ascii_digit() || c == '.');
        match word.parse() {
            Ok(value) if number => Ok(value),
            _ => Err(format!("{word:?} is neither a number nor a parameter")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arithmetic() {
        let names = BTreeMap::from([("gap".to_owned(), 5.0)]);
        let cases = [
            ("1.64 + gap", 6.64),
            ("2*(gap-1)/4", 2.0),
            ("-gap - -1", -4.0),
            ("8-2-1", 5.0),
        ];
        for (text, value) in cases {
            assert_eq!(evaluate(text, &names), Ok(value), "{text}");
        }
        for text in ["", "1 +", "gop", "(1", "1)", "nan", "2 3", &"(".repeat(500)] {
            assert!(evaluate(text, &names).is_err(), "{text}");
        }
    }
}
