"""A robot with a camera, as Debian's Python runs it: ROS 1, cv_bridge and nothing of ours.

    /usr/bin/python3 robot.py master            a master on a free port; prints its address
    /usr/bin/python3 robot.py show PLAN.json    publishes images, writes down what comes back

The plan has `topics`, `steps` and `answers`, a folder. In each step one image goes out again and
again, each time a nanosecond later, until everything that the step waits for has come back. What is
kept of a node's answers belongs to one image, told by its stamp: a node that has no camera_info yet
also answers, without a pose.
"""

import json
import sys
import threading
import time
from pathlib import Path

PERIOD = 0.25
PATIENCE = 600.0  # only tells a hang from a slow machine [s]


def master():
    from rosmaster.master import Master

    node = Master(0)
    node.start()
    print(node.uri, flush=True)
    while node.ok():
        time.sleep(0.1)


class Robot:
    def __init__(self, plan):
        import cv2
        import rospy
        from cv_bridge import CvBridge
        from geometry_msgs.msg import PoseWithCovarianceStamped
        from sensor_msgs.msg import CameraInfo, CompressedImage, Image
        from std_msgs.msg import String
        from tf2_msgs.msg import TFMessage

        self.rospy, self.cv2, self.bridge = rospy, cv2, CvBridge()
        self.CameraInfo = CameraInfo
        self.lock = threading.Lock()
        self.answers = {}
        rospy.init_node("robot", disable_signals=True)
        out = plan["topics"]
        self.images = rospy.Publisher(out["image"], Image, queue_size=1)
        self.compressed = rospy.Publisher(
            out["image"] + "/compressed", CompressedImage, queue_size=1
        )
        self.infos = rospy.Publisher(out["camera_info"], CameraInfo, queue_size=1)
        self.folder = Path(plan["answers"])
        for node in plan["nodes"]:
            for name, kind, take in (
                ("overlay", Image, self.take_image),
                ("overlay/compressed", CompressedImage, self.take_compressed),
                ("camera_pose", PoseWithCovarianceStamped, self.take_pose),
                ("status", String, self.take_status),
            ):
                rospy.Subscriber(f"/{node}/{name}", kind, take, f"{node}/{name}")
        rospy.Subscriber("/tf", TFMessage, self.take_frames)

    def keep(self, key, value):
        with self.lock:
            self.answers.setdefault(key, []).append(value)

    def take_image(self, message, key):
        image = self.bridge.imgmsg_to_cv2(message, desired_encoding="bgr8")
        self.keep(key, dict(head(message), encoding=message.encoding, image=image))

    def take_compressed(self, message, key):
        image = self.bridge.compressed_imgmsg_to_cv2(message)
        self.keep(key, dict(head(message), format=message.format, image=image))

    def take_pose(self, message, key):
        pose = message.pose.pose
        covariance = list(message.pose.covariance)
        self.keep(
            key,
            dict(head(message), **xyzw(pose.position, pose.orientation), covariance=covariance),
        )

    def take_frames(self, message):
        for transform in message.transforms:
            entry = head(transform)
            entry.update(xyzw(transform.transform.translation, transform.transform.rotation))
            self.keep("tf/" + transform.child_frame_id, entry)

    def take_status(self, message, key):
        self.keep(key, {"text": message.data})

    def play(self, number, step):
        """Publishes until all is there; returns the answers of this step."""
        bgr = self.cv2.imread(step["image"])
        if step["encoding"] == "mono8":
            bgr = self.cv2.cvtColor(bgr, self.cv2.COLOR_BGR2GRAY)
            image = self.bridge.cv2_to_imgmsg(bgr, "mono8")
        else:
            # cvtColor2 is what cv_bridge itself converts by.
            from cv_bridge.boost.cv_bridge_boost import cvtColor2

            converted = cvtColor2(bgr, "bgr8", step["encoding"])
            image = self.bridge.cv2_to_imgmsg(converted, step["encoding"])
        compressed = self.bridge.cv2_to_compressed_imgmsg(bgr, "png")
        info = self.CameraInfo(**step["camera_info"])
        with self.lock:
            self.answers = {}
        seconds, nanoseconds = step["stamp"]
        sent = []
        deadline = time.time() + PATIENCE
        while time.time() < deadline:
            sent.append([seconds, nanoseconds + len(sent)])
            for message in (image, compressed, info):
                message.header.stamp = self.rospy.Time(*sent[-1])
                message.header.frame_id = step["frame"]
            self.infos.publish(info)
            self.images.publish(image)
            self.compressed.publish(compressed)
            time.sleep(PERIOD)
            found = self.found(step, sent)
            if found is not None:
                return dict(self.written(number, found), sent=sent)
        with self.lock:
            return {"missing": [k for k in step["wait"] if k not in self.answers]}

    def found(self, step, sent):
        """Answers under all keys of this step, or None if some are missing: a status with the text
        that is waited for, the rest by node from the last image to which it gave all of them."""
        found, nodes = {}, {}
        with self.lock:
            for key in step["wait"]:
                if key.endswith("/status"):
                    texts = [a for a in self.answers.get(key, []) if step["text"] in a["text"]]
                    if not texts:
                        return None
                    found[key] = texts[-1]
                else:
                    nodes.setdefault(key.split("/")[0], []).append(key)
            for keys in nodes.values():
                given = {k: {tuple(a["stamp"]): a for a in self.answers.get(k, [])} for k in keys}
                whole = [s for s in map(tuple, sent) if all(s in given[k] for k in keys)]
                if not whole:
                    return None
                found.update((k, given[k][whole[-1]]) for k in keys)
        return found

    def written(self, number, found):
        for key, answer in found.items():
            if "image" in answer:
                path = self.folder / f"{number}_{key.replace('/', '_')}.png"
                self.cv2.imwrite(str(path), answer["image"])
                answer["image"] = str(path)
        return found


def head(message):
    header = message.header
    return {"stamp": [header.stamp.secs, header.stamp.nsecs], "frame": header.frame_id}


def xyzw(p, q):
    return {"p": [p.x, p.y, p.z], "q_xyzw": [q.x, q.y, q.z, q.w]}


def show(plan):
    robot = Robot(plan)
    results = []
    for number, step in enumerate(plan["steps"]):
        results.append(robot.play(number, step))
        if "missing" in results[-1]:
            break
    (robot.folder / "answers.json").write_text(json.dumps(results))


if __name__ == "__main__":
    if sys.argv[1] == "master":
        master()
    else:
        show(json.loads(Path(sys.argv[2]).read_text()))
