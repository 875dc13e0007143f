//! Servers, each started for one attack on a free port of loopback.
//!
//! **Invariant:** whatever is started here is a child of this program, stopped by its id, and leaves no file behind.

use std::net::{SocketAddr, TcpListener};
use std::path::PathBuf;
use std::process::{Command, Stdio};

use pendularm_benches::attack::admission::REPORT;
use pendularm_benches::attack::{Attack, TOKEN};
use pendularm_benches::program::Program;
use pendularm_benches::protocol::Protocol;

/// Bytes of the report's file that slow readers ask for.
const LARGE: usize = 8 * 1024 * 1024;

/// One that runs.
pub struct Server {
    pub protocol: Protocol,
    pub address: SocketAddr,
    pub program: Program,
}

/// How to start them; the folder in which they run.
pub struct Servers {
    program: String,
    folder: PathBuf,
}

impl Servers {
    /// Makes the folder, with a report in it, and goes there.
    pub fn new(program: &str) -> Result<Self, String> {
        let program =
            std::fs::canonicalize(program).map_err(|error| format!("{program}: {error}"))?;
        let folder = std::env::temp_dir().join(format!("pendularm-attack-{}", std::process::id()));
        let make = || {
            std::fs::create_dir_all(folder.join(REPORT))?;
            std::fs::write(
                folder.join(REPORT).join("index.html"),
                "<!doctype html><title>report</title>",
            )?;
            std::fs::write(
                folder.join(REPORT).join("large.csv"),
                "0.125,".repeat(LARGE / 6),
            )?;
            std::env::set_current_dir(&folder)
        };
        make().map_err(|error| format!("{}: {error}", folder.display()))?;
        Ok(Self {
            program: program.to_string_lossy().into_owned(),
            folder,
        })
    }

    /// Our program, as the attack wants it.
    pub fn ours(&self, attack: &Attack) -> Result<Server, String> {
        let mut arguments = vec!["--bind", "127.0.0.1:0", "--seed", "1"];
        if !attack.options.contains(&"--log") {
            arguments.extend(["--log", "warn"]);
        }
        if attack.locked {
            arguments.extend(["--token", TOKEN]);
        }
        arguments.extend(attack.options);
        let limited = attack
            .files
            .map(|files| format!("ulimit -n {files}; exec \"$0\" \"$@\""));
        let program = match &limited {
            Some(script) => {
                arguments.splice(0..0, ["-c", script, self.program.as_str()]);
                Program::start("sh", &arguments)?
            }
            None => Program::start(&self.program, &arguments)?,
        };
        Ok(Server {
            protocol: Protocol::Pendularm,
            address: program.address,
            program,
        })
    }

    /// Redis or mosquitto, as they come, but for what would be written to a disk.
    pub fn peer(&self, protocol: Protocol) -> Result<Server, String> {
        let free = TcpListener::bind("127.0.0.1:0").and_then(|socket| socket.local_addr());
        let address = free.map_err(|error| format!("no free port: {error}"))?;
        let port = address.port().to_string();
        let mut command = match protocol {
            Protocol::Redis => {
                let mut command = Command::new("redis-server");
                command.args([
                    "--bind",
                    "127.0.0.1",
                    "--port",
                    &port,
                    "--save",
                    "",
                    "--appendonly",
                    "no",
                ]);
                command
            }
            Protocol::Pendularm | Protocol::Mosquitto => {
                let file = self.folder.join("mosquitto.conf");
                let lines = format!(
                    "listener {port} 127.0.0.1\nallow_anonymous true\npersistence false\nuser root\nlog_type error\n"
                );
                std::fs::write(&file, lines)
                    .map_err(|error| format!("{}: {error}", file.display()))?;
                let mut command = Command::new("mosquitto");
                command.arg("-c").arg(file);
                command
            }
        };
        command.stdout(Stdio::null()).stderr(Stdio::null());
        Ok(Server {
            protocol,
            address,
            program: Program::at(command, address)?,
        })
    }
}

impl Drop for Servers {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}
