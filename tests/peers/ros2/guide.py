"""Somebody who guides an arm over ROS 2, with CycloneDDS: it plays a joystick.

    python3 guide.py '{"domain": 7, "velocity": [0.015, 0, 0, 0, 0, 0]}'

It publishes velocities in `frame` while it guides. It reads words: `guide` and `rest` begin and end it, `second` lets another
program guide too, and `nan` spoils the first number. It prints a line of JSON for each word.
"""

import json
import os
import sys
import threading
import time

SETTINGS = {
    "domain": 0,
    "topic": "/guide/twist",
    "type": "TwistStamped",
    "frame": "tactile_pad",
    "velocity": [0.015, 0.0, 0.0, 0.0, 0.0, 0.0],
    "rate": 50.0,
    "stamp_offset": 0.0,
    "has_stamp": True,
    **json.loads(sys.argv[1]),
}
os.environ["CYCLONEDDS_URI"] = (
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name='lo' multicast='false'/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
    "<MaxAutoParticipantIndex>20</MaxAutoParticipantIndex><Peers><Peer address='127.0.0.1'/></Peers></Discovery>"
    "</Domain></CycloneDDS>"
)

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.topic import Topic
from cyclonedds.util import duration

import messages as ros


def message(velocity):
    if SETTINGS["type"] == "String":
        return ros.String(data="hello")
    stamp = ros.Time.of(time.time() + SETTINGS["stamp_offset"]) if SETTINGS["has_stamp"] else ros.Time()
    linear, angular = ros.Vector3(*map(float, velocity[:3])), ros.Vector3(*map(float, velocity[3:]))
    return ros.TwistStamped(ros.Header(stamp, SETTINGS["frame"]), ros.Twist(linear, angular))


def main():
    participant = DomainParticipant(SETTINGS["domain"])
    topic = Topic(participant, f"rt{SETTINGS['topic']}", getattr(ros, SETTINGS["type"]))
    qos = Qos(Policy.Reliability.Reliable(duration(milliseconds=100)), Policy.History.KeepLast(1))
    writers, words, guides = [DataWriter(participant, topic, qos=qos)], [], False
    velocity = list(SETTINGS["velocity"])
    threading.Thread(target=lambda: [words.append(line.strip()) for line in sys.stdin], daemon=True).start()
    print(json.dumps({"is_ready": True}), flush=True)
    while True:
        while words:
            word = words.pop(0)
            if word in ("guide", "rest"):
                guides = word == "guide"
            elif word == "second":
                writers.append(DataWriter(participant, topic, qos=qos))
            elif word == "nan":
                velocity[0] = float("nan")
            print(json.dumps({"heard": word, "t": time.time()}), flush=True)
        for writer in writers if guides else []:
            writer.write(message(velocity))
        time.sleep(1.0 / SETTINGS["rate"])


main()
