"""The page in one file, opened from disk: the arm under test is in the page itself.

Invariant: it has the interface of `runtime.Runtime`, as far as a page without a server can have it.
"""

import json
import os
import pathlib

from runtime import Runtime

FILE = pathlib.Path(os.environ.get("PAGE", "pendularm.html")).resolve()

# Calls past the page: the answers have ids that the page does not know.
CALL = """new Promise((done) => {
  const kernel = pendularm["kernel.js"].Kernel.current, before = kernel.onmessage, id = `test-${Math.random()}`;
  kernel.onmessage = (event) => {
    const frame = JSON.parse(event.data);
    if (frame.op === "service_response" && frame.id === id) { kernel.onmessage = before; done(frame); } else before(event);
  };
  kernel.send(JSON.stringify({ op: "call_service", id, service: %s, args: %s }));
})"""
# The next message of a topic to which the page has subscribed.
NEXT = """new Promise((done) => {
  const kernel = pendularm["kernel.js"].Kernel.current, before = kernel.onmessage;
  kernel.onmessage = (event) => {
    before(event);
    const frame = JSON.parse(event.data);
    if (frame.op === "publish" && frame.topic === %s) { kernel.onmessage = before; done(frame.msg); }
  };
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
        return self.page.run(CALL % (json.dumps(service), json.dumps(args)))

    def next(self, topic):
        return self.page.run(NEXT % json.dumps(topic))
