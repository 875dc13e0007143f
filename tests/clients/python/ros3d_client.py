"""ros3d, unmodified, in a headless Chromium: `ros3d_client.py HOST:PORT`. It shows the arm by its URDF and by
tf2_web_republisher, which needs roslib 1; the two lie in `node/node_modules`."""

import functools
import http.server
import math
import sys
import threading
import time
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
sys.path.insert(0, str(FOLDER.parents[1] / "browser"))

from chromium import Browser  # noqa: E402 - the path comes first

PATIENCE = 60
WIDTH, HEIGHT = 400, 300

# As ros3d's own examples have it.
PAGE = """<!DOCTYPE html>
<link rel="icon" href="data:,">
<div id="view"></div>
<script src="/roslib1/build/roslib.js"></script>
<script src="/ros3d/build/ros3d.js"></script>
<script>
  const ros = new ROSLIB.Ros({ url: "ws://ADDRESS" });
  const viewer = new ROS3D.Viewer({ divID: "view", width: 400, height: 300, antialias: false, background: "#ffffff" });
  const tfClient = new ROSLIB.TFClient({ ros, fixedFrame: "/world", angularThres: 0.001, transThres: 0.001, rate: 30 });
  const urdf = new ROS3D.UrdfClient({ ros, tfClient, rootObject: viewer.scene, param: "robot_description" });
  /** Where a link stands on the scene, as ros3d has put it. */
  const place = (link) => {
    const node = urdf.urdf?.children.find((one) => one.frameID.replace("/", "") === link);
    return node?.visible ? [node.position.x, node.position.y, 2 * Math.atan2(node.quaternion.z, node.quaternion.w)] : null;
  };
  const service = (name, args) => new Promise((resolve, reject) => {
    new ROSLIB.Service({ ros, name, serviceType: "" }).callService(new ROSLIB.ServiceRequest(args), resolve, reject);
  });
</script>
"""


class Files(http.server.SimpleHTTPRequestHandler):
    """The packages, and the page."""

    def do_GET(self):
        if self.path != "/":
            return super().do_GET()
        body = PAGE.replace("ADDRESS", sys.argv[1]).encode()
        self.send_response(200)
        self.send_header("content-type", "text/html")
        self.send_header("content-length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_):
        pass


def differs(angle, other):
    return abs(math.remainder(angle - other, math.tau))


packages = functools.partial(Files, directory=FOLDER.parent / "node" / "node_modules")
server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), packages)
threading.Thread(target=server.serve_forever, daemon=True).start()

# WebGL without a graphics card.
SOFTWARE = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
with Browser(extra=SOFTWARE) as browser:
    page = browser.page(f"http://127.0.0.1:{server.server_port}/", width=WIDTH, height=HEIGHT)
    page.until("place('link2') !== null", PATIENCE, "the arm on the scene")
    page.run("service('/pid_controller/enable', {data: true})")
    # The solution nearest to the present pose. The arm must not move between the request and the goal.
    page.run("service('/arm_sim/pause', {data: true})")
    wanted = page.run("service('/ik/solve', {x: 0.5, y: 1.2})")["positions"]
    page.run("service('/ik_action/send_goal', {x: 0.5, y: 1.2})")
    page.run("service('/arm_sim/pause', {data: false})")

    # Both links are a metre long; a link is drawn around its middle.
    turned = sum(wanted)
    middle = math.cos(wanted[0]) + math.cos(turned) / 2, math.sin(wanted[0]) + math.sin(turned) / 2
    end = time.monotonic() + PATIENCE
    while True:
        x, y, angle = page.run("place('link2')")
        if math.hypot(x - middle[0], y - middle[1]) < 0.02 and differs(angle, turned) < 0.02:
            break
        assert time.monotonic() < end, (x, y, angle, middle, turned)
        time.sleep(0.1)
    picture = page.decode(page.screenshot())
    drawn = sum(picture[x, y] != (255, 255, 255) for x in range(0, WIDTH, 4) for y in range(0, HEIGHT, 4))
    assert drawn > 20, f"{drawn} places of the picture are not empty"

print("ros3d: ok")
