"""The page in one file, opened from disk: the arm under test is in the page itself.

Invariant: it has the interface of `runtime.Runtime`, as far as a page without a server can have it.
"""

import json
import os
import pathlib

from runtime import Runtime

FILE = pathlib.Path(os.environ.get("PAGE", "pendularm.html")).resolve()

# Waits for a frame of the kernel, after sending one. The page receives both, and ignores answers to unknown ids.
HEAR = """new Promise((done) => {
  const kernel = pendularm["kernel.js"].Kernel.current, before = kernel.onmessage;
  kernel.onmessage = (event) => {
    before(event);
    const frame = JSON.parse(event.data);
    if (Object.entries(%s).every(([key, value]) => frame[key] === value)) { kernel.onmessage = before; done(frame); }
  };
  const sent = %s;
  if (sent) kernel.send(JSON.stringify(sent));
})"""


class Alone(Runtime):
    """The arm in the page that was opened last."""

    def __init__(self, links=2):
        self.links = links
        self.page = None

    def __exit__(self, *_):
        pass

    def restart(self, links=None):
        self.links = links or self.links
        self.page.go("about:blank")
        self.page.go(f"{self.url}#workbench")

    @property
    def url(self):
        return f"{FILE.as_uri()}?links={self.links}"

    def call(self, service, **args):
        return self.hear({"op": "service_response", "id": "test"}, {"op": "call_service", "id": "test", "service": service, "args": args})

    def next(self, topic):
        """The next message of a topic to which the page has subscribed."""
        return self.hear({"op": "publish", "topic": topic})["msg"]

    def hear(self, wanted, sent=None):
        return self.page.run(HEAR % (json.dumps(wanted), json.dumps(sent)))
