//! Arguments that ROS 2 programs share: `--ros-args ... [--]`, as `ros2 run` and launch files pass them.

use palpate_cli::failure::Failure;

/// Namespace, name of the node, and other names of topics.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RosArguments {
    /// Namespace of the node, from `__ns`.
    pub namespace: Option<String>,
    /// Name of the node, from `__node`.
    pub node: Option<String>,
    /// Topics, each with its new name.
    pub remapped: Vec<(String, String)>,
}

const START: &str = "--ros-args";

impl RosArguments {
    /// Takes these arguments out of a program's arguments.
    ///
    /// # Errors
    /// If one is not understood.
    pub fn take(arguments: &mut Vec<String>) -> Result<Self, Failure> {
        let mut taken = Self::default();
        while let Some(start) = arguments.iter().position(|argument| argument == START) {
            let after = arguments.split_off(start);
            let mut words = after.into_iter().skip(1);
            while let Some(word) = words.next().filter(|word| word != "--") {
                taken.enter(&word, &mut words)?;
            }
            arguments.extend(words);
        }
        Ok(taken)
    }

    fn enter(
        &mut self,
        word: &str,
        words: &mut impl Iterator<Item = String>,
    ) -> Result<(), Failure> {
        match word {
            START => {}
            "-r" | "--remap" => self.remap(&words.next().unwrap_or_default())?,
            // Settings of the client libraries in C, which this program does not use.
            "--log-level" | "--log-config-file" => drop(words.next()),
            _ if word.starts_with("--enable-") || word.starts_with("--disable-") => {}
            "-p" | "--param" | "--params-file" => {
                let value = words.next().unwrap_or_default();
                return Err(Failure::Argument(format!(
                    "{word} {value}: this node has no parameters; `palpate-ros --help` lists its options, which come before \
                     {START}"
                )));
            }
            _ => {
                return Err(Failure::Argument(format!(
                    "{word} is not known after {START}: allowed are `-r FROM:=TO`, `-r __ns:=/NAMESPACE`, \
                     `-r __node:=NAME` and `--log-level LEVEL`"
                )));
            }
        }
        Ok(())
    }

    fn remap(&mut self, rule: &str) -> Result<(), Failure> {
        let Some((from, to)) = rule.split_once(":=") else {
            return Err(Failure::Argument(format!(
                "-r {rule}: write FROM:=TO, such as force:=wrench or __ns:=/robot1"
            )));
        };
        // A rule may name its node, as `palpate:__ns:=/robot1`; there is one node here.
        match from.rsplit(':').next().unwrap_or(from) {
            "__ns" => self.namespace = Some(to.to_owned()),
            "__node" | "__name" => self.node = Some(to.to_owned()),
            topic => self.remapped.push((topic.to_owned(), to.to_owned())),
        }
        Ok(())
    }

    /// Full name of a topic of the node at `path`; `topic` may begin with `~/` or `/`.
    pub fn full_name(path: &str, topic: &str) -> String {
        let namespace = path.rsplit_once('/').map_or("", |(namespace, _)| namespace);
        match (topic.strip_prefix("~/"), topic.starts_with('/')) {
            (Some(own), _) => format!("{path}/{own}"),
            (None, true) => topic.to_owned(),
            (None, false) => format!("{namespace}/{topic}"),
        }
    }

    /// Full name of a topic after the rules.
    pub fn topic(&self, path: &str, topic: &str) -> String {
        let name = Self::full_name(path, topic);
        let mut rules = self.remapped.iter();
        let rule = rules.find(|(from, _)| Self::full_name(path, from) == name);
        rule.map_or(name, |(_, to)| Self::full_name(path, to))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn taken(line: &str) -> (Result<RosArguments, Failure>, Vec<String>) {
        let mut words: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
        (RosArguments::take(&mut words), words)
    }

    #[test]
    fn what_a_launch_file_passes_is_taken_out() {
        let (taken, rest) = taken(
            "--arm --ros-args -r __node:=finger -r __ns:=/robot1 -r ~/left/force:=wrench --log-level info -- --domain 3",
        );
        let taken = taken.unwrap();
        assert_eq!(rest, ["--arm", "--domain", "3"]);
        assert_eq!(taken.namespace.as_deref(), Some("/robot1"));
        assert_eq!(taken.node.as_deref(), Some("finger"));
        let path = "/robot1/finger";
        assert_eq!(taken.topic(path, "~/left/force"), "/robot1/wrench");
        assert_eq!(
            taken.topic(path, "~/left/touch"),
            "/robot1/finger/left/touch"
        );
        assert_eq!(taken.topic(path, "/diagnostics"), "/diagnostics");
    }

    #[test]
    fn what_is_not_understood_is_refused_with_what_is_allowed() {
        for (line, word) in [
            ("--ros-args -p rate:=3", "no parameters"),
            ("--ros-args --colour", "__node:=NAME"),
            ("--ros-args -r force", "FROM:=TO"),
        ] {
            let text = taken(line).0.unwrap_err().to_string();
            assert!(text.contains(word), "{text}");
        }
    }
}
