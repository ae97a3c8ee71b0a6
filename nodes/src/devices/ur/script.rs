//! The program that runs on the robot and follows our velocities.

use tactflow_runtime::node::{FilePath, Mistake, Mistakes};

use super::template::{Version, choose, fill, has_conditions};

/// Our own program. See `docs/ur.md`.
const OWN: &str = include_str!("../../../../graphs/robots/ur/tactflow.urscript");
/// What a program must contain so that each message sets the time after which it stops.
const TIMEOUT_MARK: &str = "read_timeout";

/// The text of a program with placeholders.
#[derive(Debug, Clone)]
pub(super) struct Script {
    text: String,
    /// Whether it is the maker's program, which opens two more connections.
    pub(super) is_vendor: bool,
}

/// Where the program connects to.
#[derive(Debug, Clone)]
pub(super) struct Ports<'h> {
    /// Our address, as the robot sees it.
    pub(super) host: &'h str,
    /// The port that gets velocities.
    pub(super) reverse: u16,
    /// The ports that only the maker's program opens.
    pub(super) trajectory: u16,
    pub(super) command: u16,
}

impl Script {
    /// Our own program.
    pub(super) fn own() -> Self {
        Self { text: OWN.to_owned(), is_vendor: false }
    }

    /// Reads the maker's program.
    ///
    /// # Errors
    /// If the file cannot be read, is not a program of this kind, or is too old or too new.
    pub(super) fn vendor(file: &FilePath) -> Result<Self, Mistakes> {
        let bytes = file.bytes()?;
        let script = Self { text: String::from_utf8_lossy(&bytes).into_owned(), is_vendor: true };
        let refuse = |why: String| -> Mistakes {
            let message = format!("`{}` cannot be used: {why}", file.path.display());
            let help = "use `external_control.urscript` of Universal_Robots_Client_Library from after September 2023; \
                without `script`, tactflow sends its own program";
            Mistake::param("script", message).help(help).into()
        };
        if !script.text.contains("{{SERVER_PORT_REPLACE}}") {
            return Err(refuse("it has no placeholder `{{SERVER_PORT_REPLACE}}`".into()));
        }
        if !script.text.contains(TIMEOUT_MARK) {
            let why = format!("it has no `{TIMEOUT_MARK}`, so a message cannot state when the robot stops");
            return Err(refuse(why));
        }
        // Each series of controllers reads other lines.
        for version in [[3, 15, 0], [5, 9, 0], [5, 25, 1], [10, 12, 0]] {
            let ports = Ports { host: "127.0.0.1", reverse: 1, trajectory: 2, command: 3 };
            script.body(&ports, Some(version)).map_err(refuse)?;
        }
        Ok(script)
    }

    /// Whether the program differs between versions of the controller's software.
    pub(super) fn needs_version(&self) -> bool {
        has_conditions(&self.text)
    }

    /// Returns the program for a node of External Control.
    ///
    /// # Errors
    /// If a placeholder or a condition is not understood.
    pub(super) fn body(&self, ports: &Ports<'_>, version: Option<Version>) -> Result<String, String> {
        let chosen = match (has_conditions(&self.text), version) {
            (false, _) => self.text.clone(),
            (true, Some(version)) => choose(&self.text, version)?,
            (true, None) => return Err("the controller does not state its version, but the program needs it".into()),
        };
        let [reverse, trajectory, command] =
            [ports.reverse, ports.trajectory, ports.command].map(|port| port.to_string());
        let values = [
            ("SERVER_IP_REPLACE", ports.host),
            ("SERVER_PORT_REPLACE", &reverse),
            ("TRAJECTORY_SERVER_PORT_REPLACE", &trajectory),
            ("SCRIPT_COMMAND_SERVER_PORT_REPLACE", &command),
            ("BEGIN_REPLACE", ""),
            ("JOINT_STATE_REPLACE", "1000000"),
            ("TIME_REPLACE", "1000"),
            // The driver never sends a target of `servoj`.
            ("SERVO_J_REPLACE", "lookahead_time=0.03, gain=2000"),
        ];
        fill(&chosen, &values)
    }

    /// Returns the program as a function of its own, which the controller runs when it has received it.
    ///
    /// # Errors
    /// If a placeholder or a condition is not understood.
    pub(super) fn program(&self, ports: &Ports<'_>, version: Option<Version>) -> Result<String, String> {
        let body = self.body(ports, version)?;
        let lines: String = body.lines().map(|line| format!("  {line}\n")).collect();
        Ok(format!("def tactflow():\n{lines}end\n"))
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    const PORTS: Ports<'_> = Ports { host: "10.1.2.3", reverse: 50001, trajectory: 50003, command: 50004 };

    #[test]
    fn our_program_names_where_it_connects_to_and_stops_on_silence() {
        let program = Script::own().program(&PORTS, None).unwrap();
        assert!(program.starts_with("def tactflow():\n") && program.ends_with("\nend\n"));
        assert!(program.contains("socket_open(\"10.1.2.3\", 50001, "));
        for needed in ["socket_read_binary_integer(8, ", "speedj(", "stopj(4.0)", "get_steptime()"] {
            assert!(program.contains(needed), "{needed}");
        }
        assert!(!program.contains("{{") && !Script::own().needs_version());
        // Blocks are closed: each opener has its `end`.
        let words = |line: &str| line.split('#').next().unwrap().trim().to_owned();
        let opens = |line: &String| ["def ", "while ", "if ", "thread "].iter().any(|word| line.starts_with(word));
        let lines: Vec<String> = program.lines().map(words).collect();
        assert_eq!(lines.iter().filter(|line| opens(line)).count(), lines.iter().filter(|line| *line == "end").count());
    }

    fn vendor(text: &str) -> Result<Script, String> {
        let folder = std::env::temp_dir().join(format!("tactflow-ur-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let path = folder.join(format!("{}.urscript", text.len()));
        fs::write(&path, text).unwrap();
        let script = Script::vendor(&FilePath { path: path.clone(), span: 0..0, builtin: None });
        fs::remove_file(path).unwrap();
        script.map_err(|mistakes| mistakes[0].message.split_once(": ").unwrap().1.to_owned())
    }

    /// Our own words, in the shape of the maker's program.
    const SHAPE: &str = "{{BEGIN_REPLACE}}\nm = {{JOINT_STATE_REPLACE}}\nread_timeout = 1\n\
        socket_open(\"{{SERVER_IP_REPLACE}}\", {{SERVER_PORT_REPLACE}}, \"r\")\n";

    #[test]
    fn the_makers_program_is_filled() {
        let body = vendor(SHAPE).unwrap().body(&PORTS, None).unwrap();
        assert_eq!(body, "\nm = 1000000\nread_timeout = 1\nsocket_open(\"10.1.2.3\", 50001, \"r\")\n");
        let text =
            format!("{SHAPE}{{% if ROBOT_SOFTWARE_VERSION >= v5.9.1 %}}\nnew()\n{{% else %}}\nold()\n{{% endif %}}\n");
        let script = vendor(&text).unwrap();
        assert!(script.needs_version());
        assert!(script.body(&PORTS, Some([5, 9, 1])).unwrap().ends_with("new()\n"));
        assert!(script.body(&PORTS, Some([5, 9, 0])).unwrap().ends_with("old()\n"));
        assert!(script.body(&PORTS, None).is_err());
    }

    #[test]
    fn a_program_of_another_kind_is_refused() {
        for (text, why) in [
            ("print()", "it has no placeholder `{{SERVER_PORT_REPLACE}}`"),
            (
                "{{SERVER_PORT_REPLACE}} keepalive",
                "it has no `read_timeout`, so a message cannot state when the robot stops",
            ),
            (&format!("{SHAPE}{{{{FORCE_REPLACE}}}}"), "the placeholder `{{FORCE_REPLACE}}` is unknown"),
            (&format!("{SHAPE}{{% if LICENCE %}}\n{{% endif %}}"), "line 5: the condition `LICENCE` is not understood"),
        ] {
            assert_eq!(vendor(text).err().as_deref(), Some(why));
        }
    }
}
