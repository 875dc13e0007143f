"""ros-mcp, unmodified, by which language models drive robots: `ros_mcp_client.py HOST:PORT`. Its server is spoken to by MCP's own client."""

import asyncio
import json
import os
import sys
from pathlib import Path

from mcp import ClientSession, StdioServerParameters
from mcp.client.stdio import stdio_client

PATIENCE = 60

host, port = sys.argv[1].rsplit(":", 1)


async def drive(session):
    async def use(tool, **arguments):
        """The answer of one of its tools."""
        result = await session.call_tool(tool, arguments)
        text = "".join(part.text for part in result.content)
        assert not result.isError, (tool, text)
        return json.loads(text)

    connected = await use("connect_to_robot", ip=host, port=int(port))
    assert connected["connectivity_test"]["port_check"]["open"], connected
    assert "warning" not in connected, connected
    topics = await use("get_topics")
    assert "/joint_states" in topics["topics"], topics
    gravity = await use("get_parameter", name="/arm_sim:gravity")
    assert float(gravity["value"]) == 9.81, gravity
    state = await use("subscribe_once", topic="/joint_states", msg_type="sensor_msgs/msg/JointState", timeout=PATIENCE)
    assert state["msg"]["name"] == ["joint1", "joint2"], state

    async def call(service, request):
        details = await use("get_service_type", service=service)
        return await use("call_service", service_name=service, service_type=details["type"], request=request)

    enabled = await call("/pid_controller/enable", {"data": True})
    assert enabled["success"] and enabled["result"] == {"data": True}, enabled
    refused = await call("/ik/solve", {"x": 9, "y": 9})
    assert not refused["success"] and "beyond" in json.dumps(refused), refused
    moved = await use(
        "send_action_goal", action_name="/ik_action", action_type="pendularm_interfaces/action/MoveTo",
        goal={"x": 0.5, "y": 1.2}, timeout=PATIENCE)
    assert moved["success"] and "reached" in json.dumps(moved), moved


async def main():
    server = StdioServerParameters(command=str(Path(sys.executable).with_name("ros-mcp")), args=[])
    # It logs every read of its socket.
    log = open(os.devnull, "w")
    async with stdio_client(server, errlog=log) as (reads, writes), ClientSession(reads, writes) as session:
        await session.initialize()
        await asyncio.wait_for(drive(session), PATIENCE)


asyncio.run(main())
print("ros-mcp: ok")
