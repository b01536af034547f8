"""A camera in ROS 2, by rclpy and nothing of ours: publishes images, writes down what comes back.

    python ros2_camera.py PICTURE.npy INFO.json reliable|best_effort IMAGES SECONDS

One image at a time goes out to `/camera/image_raw`; the next follows when the pose of the node
`burg_board` has come back. With best effort an image may be lost on the way, and is sent again.
Prints one line of JSON: the pose and overlay of each image, and how often each was sent; or ends
with an error after SECONDS.
"""

import array
import json
import sys
import time
from pathlib import Path

import numpy as np
import rclpy
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import CameraInfo, Image

RESEND_PERIOD = 0.2  # seconds


class Camera:
    def __init__(self, picture, info, reliable, seconds):
        self.deadline = time.monotonic() + seconds
        policy = ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT
        qos = QoSProfile(depth=1, reliability=policy)
        self.node = rclpy.create_node("camera")
        self.images = self.node.create_publisher(Image, "/camera/image_raw", qos)
        self.infos = self.node.create_publisher(CameraInfo, "/camera/camera_info", qos)
        self.poses, self.overlays = {}, {}
        for topic, kind, take in (
            ("camera_pose", PoseWithCovarianceStamped, self.take_pose),
            ("overlay", Image, self.take_overlay),
        ):
            self.node.create_subscription(kind, f"/burg_board/{topic}", take, 10)
        self.info = CameraInfo(**info)
        self.image = Image(height=picture.shape[0], width=picture.shape[1], encoding="rgb8")
        self.image.step = 3 * picture.shape[1]
        self.image.data = array.array("B", picture.tobytes())

    def take_pose(self, message):
        p, q = message.pose.pose.position, message.pose.pose.orientation
        pose = {"p": [p.x, p.y, p.z], "q_wxyz": [q.w, q.x, q.y, q.z]}
        self.poses[message.header.stamp.sec] = {**pose, "frame": message.header.frame_id}

    def take_overlay(self, message):
        self.overlays[message.header.stamp.sec] = [message.height, message.width, message.encoding]

    def answer(self, number, resend):
        """The answer to an image, which has its number as stamp; and how often it was sent."""
        for message in (self.info, self.image):
            message.header.stamp.sec = number
            message.header.frame_id = "eye"
        again, sent = 0.0, 0
        while number not in self.poses or number not in self.overlays:
            if time.monotonic() > self.deadline:
                sys.exit(f"no answer to image {number} of {sorted(self.poses)}")
            if not sent or (resend and time.monotonic() > again):
                self.infos.publish(self.info)
                self.images.publish(self.image)
                again, sent = time.monotonic() + RESEND_PERIOD, sent + 1
            rclpy.spin_once(self.node, timeout_sec=0.05)
        return {**self.poses[number], "overlay": self.overlays[number], "sent": sent}


def main():
    picture, info = np.load(sys.argv[1]), json.loads(Path(sys.argv[2]).read_text())
    reliable, count = sys.argv[3] == "reliable", int(sys.argv[4])
    rclpy.init()
    camera = Camera(picture, info, reliable, float(sys.argv[5]))
    while not camera.images.get_subscription_count() and time.monotonic() < camera.deadline:
        rclpy.spin_once(camera.node, timeout_sec=0.05)
    # The first image finds the node while endpoints are still being matched.
    camera.answer(1, resend=True)
    answers = [camera.answer(number, resend=not reliable) for number in range(2, count + 2)]
    print(json.dumps(answers))


main()
