"""Somebody who reads topics of ROS 2, over CycloneDDS: it plays RViz, PlotJuggler and a recorder.

    python3 listener.py '{"domain": 7, "topics": {"/tactflow/pad/image": ["Image", "reliable"]}}'

It prints a line of JSON for each message: `topic`, `received` [s, wall clock] and `message`, with all fields of the message.
The data of an image is a list of its numbers.
"""

import dataclasses
import json
import os
import sys
import time

SETTINGS = json.loads(sys.argv[1])
os.environ["CYCLONEDDS_URI"] = (
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name='lo' multicast='false'/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
    "<MaxAutoParticipantIndex>20</MaxAutoParticipantIndex><Peers><Peer address='127.0.0.1'/></Peers></Discovery>"
    "</Domain></CycloneDDS>"
)

import numpy as np
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.internal import InvalidSample
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

import messages as ros

RELIABILITY = {
    "reliable": Policy.Reliability.Reliable(duration(milliseconds=100)),
    "best_effort": Policy.Reliability.BestEffort,
}


def fields(message):
    made = dataclasses.asdict(message)
    if isinstance(message, ros.Image):
        made["data"] = np.frombuffer(bytes(message.data), "<f4").tolist()
    return made


def main():
    participant = DomainParticipant(SETTINGS["domain"])
    readers = {}
    for name, (kind, reliability) in SETTINGS["topics"].items():
        topic = Topic(participant, f"rt{name}", getattr(ros, kind))
        qos = Qos(RELIABILITY[reliability], Policy.History.KeepLast(10))
        readers[name] = DataReader(participant, topic, qos=qos)
    print(json.dumps({"is_ready": True}), flush=True)
    while True:
        for name, reader in readers.items():
            for message in reader.take(N=100):
                if not isinstance(message, InvalidSample):
                    line = {"topic": name, "received": time.time(), "message": fields(message)}
                    print(json.dumps(line), flush=True)
        time.sleep(0.005)


main()
