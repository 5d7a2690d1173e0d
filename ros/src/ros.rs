//! The node, its topics and their quality of service.

use std::fmt::Display;
use std::net::Ipv4Addr;

use palpate_cli::failure::Failure;
use palpate_cli::finding::Finding;
use palpate_cli::notice;
use ros2_client::log::LogLevel;
use ros2_client::{
    Context, MessageTypeName, Node, NodeLoggingHandle, NodeName, NodeOptions, Publisher, rosout,
};
use rustdds::policy::{Durability, History, Reliability, ResourceLimits};
use rustdds::{DomainParticipantBuilder, Duration, QosPolicies, QosPolicyBuilder, TopicKind};

use crate::messages::Named;
use crate::ros_arguments::RosArguments;

/// Messages that wait for a subscriber's acknowledgement, at most: 25 s at the highest rate of a board.
/// A subscriber that was killed is known to be gone after the lease of Fast DDS, 20 s; until then nothing
/// may stop for the others.
const UNACKNOWLEDGED: i32 = 125_000;
/// Messages that are kept without a subscriber, or for one that asks for no acknowledgement.
const KEPT: i32 = 1000;
/// Highest domain that ROS 2 allows on every system.
pub const HIGHEST_DOMAIN: u16 = 232;

/// Where the node is, and how it publishes.
#[derive(Clone, Debug)]
pub struct Place {
    /// Domain.
    pub domain_id: u16,
    /// Reach subscribers on this computer alone.
    pub localhost: bool,
    /// Send each message once, without acknowledgement.
    pub best_effort: bool,
    /// Namespace of the node.
    pub namespace: String,
    /// Name of the node.
    pub node: String,
}

/// The node.
pub struct Ros {
    context: Context,
    node: Node,
    path: String,
    arguments: RosArguments,
    best_effort: bool,
}

impl Ros {
    /// Joins the domain.
    ///
    /// # Errors
    /// If a name is not allowed, or the network cannot be used.
    pub fn join(place: &Place, arguments: RosArguments) -> Result<Self, Failure> {
        let namespace = arguments.namespace.as_ref().unwrap_or(&place.namespace);
        let name = arguments.node.as_ref().unwrap_or(&place.node);
        let node_name = NodeName::new(namespace, name).map_err(|error| {
            Failure::Argument(format!(
                "node {namespace} {name}: {error}; a name has letters, digits and _, a namespace begins with /"
            ))
        })?;
        let mut participant = DomainParticipantBuilder::new(place.domain_id);
        if place.localhost {
            participant = participant.with_only_networks([Ipv4Addr::LOCALHOST]);
        }
        let participant = participant.build().map_err(unreached)?;
        let context = Context::from_domain_participant(participant).map_err(unreached)?;
        let options = NodeOptions::new().start_parameter_services(false);
        let node = context.new_node(node_name, options).map_err(unreached)?;
        let path = format!("{}/{name}", namespace.trim_end_matches('/'));
        Ok(Self {
            context,
            node,
            path,
            arguments,
            best_effort: place.best_effort,
        })
    }

    /// Full name of the node.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// Publishes at a topic; `~/` stands for the node's name.
    ///
    /// # Errors
    /// If the topic cannot be made.
    pub fn publisher<M: Named>(&mut self, topic: &str) -> Result<Publisher<M>, Failure> {
        let topic = self.arguments.topic(&self.path, topic);
        let (package, name) = M::NAME;
        let type_name = MessageTypeName::new(package, name).dds_msg_type();
        let participant = self.context.domain_participant();
        let topic = participant.create_topic(
            format!("rt{topic}"),
            type_name,
            &self.quality(),
            TopicKind::NoKey,
        );
        let topic = topic.map_err(unreached)?;
        self.node.create_publisher(&topic, None).map_err(unreached)
    }

    /// Reliable, so that every subscriber gets what it asks for; a write waits for no one.
    fn quality(&self) -> QosPolicies {
        let reliability = if self.best_effort {
            Reliability::BestEffort
        } else {
            Reliability::Reliable {
                max_blocking_time: Duration::ZERO,
            }
        };
        QosPolicyBuilder::new()
            .reliability(reliability)
            .durability(Durability::Volatile)
            .history(History::KeepLast { depth: KEPT })
            .resource_limits(ResourceLimits {
                max_samples: UNACKNOWLEDGED,
                max_instances: 1,
                max_samples_per_instance: UNACKNOWLEDGED,
            })
            .build()
    }

    /// A log of the node, for any thread.
    pub fn log(&self) -> Log {
        Log(self.node.logging_handle())
    }
}

fn unreached(error: impl Display) -> Failure {
    Failure::Unconnected(Finding::new(
        "no_ros",
        format!("ROS 2 cannot be joined: {error}"),
        "Check that the network, or the loopback with --localhost, is up and carries multicast",
    ))
}

/// Standard error, and `/rosout`.
pub struct Log(NodeLoggingHandle);

impl Log {
    /// Logs what goes well.
    pub fn info(&self, line: &str) {
        self.say(LogLevel::Info, line);
    }

    /// Logs what does not.
    pub fn warn(&self, line: &str) {
        self.say(LogLevel::Warn, line);
    }

    fn say(&self, level: LogLevel, line: &str) {
        notice::say(format_args!("palpate-ros: {line}"));
        rosout!(self.0, level, "{line}");
    }
}
