"""`burg-drake ros`: a ROS 2 node for robots."""

from __future__ import annotations

import argparse

from burg_drake.apps import options
from burg_drake.apps.terminal import sigterm_as_interrupt


def add_ros_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake ros`."""
    from burg_drake.ros import NodeNames, ParentFrame

    parser.epilog = options.examples_text(
        "burg-drake ros tabletop_six --image /camera/color/image_raw",
        "burg-drake ros my_scene.yaml --image /usb_cam/image_raw/compressed --frame board_link",
    )
    options.add_scene(parser)
    parser.add_argument(
        "--image",
        metavar="TOPIC",
        default="/camera/image_raw",
        help="image topic; compressed if it ends in /compressed (default: %(default)s)",
    )
    parser.add_argument(
        "--camera-info",
        metavar="TOPIC",
        default="",
        help="intrinsics topic (default: camera_info beside the images)",
    )
    options.add_intrinsics(parser, "intrinsics file instead of the topic")
    parser.add_argument(
        "--rectified", action="store_true", help="the images have no distortion (image_rect)"
    )
    options.add_measured_board(parser)
    parser.add_argument(
        "--frame",
        metavar="NAME",
        default=NodeNames.board_frame,
        help="tf frame of the board (default: %(default)s)",
    )
    parser.add_argument(
        "--tf-parent",
        choices=[parent.value for parent in ParentFrame],
        default=NodeNames.parent.value,
        help="tf parent; none publishes nothing on tf (default: %(default)s)",
    )
    parser.add_argument(
        "--name",
        metavar="NODE",
        default=NodeNames.node,
        help="name of the node, which publishes NAME/overlay, NAME/camera_pose, NAME/status"
        " (default: %(default)s)",
    )
    parser.add_argument(
        "--distro", type=int, choices=(1, 2), help="version of ROS (default: the one that is here)"
    )


def run_ros(arguments: argparse.Namespace) -> int:
    """Serves until Ctrl-C, SIGTERM or ROS ends it."""
    from burg_drake.ros import NodeNames, ParentFrame, choose_distribution, start_ros_node

    names = NodeNames(
        node=arguments.name,
        image=arguments.image,
        camera_info=arguments.camera_info,
        board_frame=arguments.frame,
        parent=ParentFrame(arguments.tf_parent),
    )
    version = choose_distribution(arguments.distro)

    from burg_drake.cameras import load_intrinsics
    from burg_drake.ros import BoardNode, run_node
    from burg_drake.scene import load_scene

    intrinsics = load_intrinsics(arguments.intrinsics) if arguments.intrinsics else None
    scene = load_scene(arguments.scene)
    scene.require_markers()
    node = BoardNode(
        scene,
        intrinsics=intrinsics,
        rectified=arguments.rectified,
        print_scale=options.print_scale_from_options(arguments),
    )
    with sigterm_as_interrupt():  # launchers send SIGTERM if SIGINT did not end the node
        link = start_ros_node(version, names, with_camera_info=intrinsics is None)
        try:
            link.log(f"{scene.name}: ROS {version}, images from {names.image}")
            run_node(link, node)
        except KeyboardInterrupt:
            pass
        finally:
            link.close()
    return 0
