"""A client of the live stream, in a process of its own: prints what it has received as one JSON object.

``python live_client.py URL TOPIC,TOPIC`` receives a message of each topic; the WebSocket is that of Tornado.
"""

import asyncio
import base64
import json
import struct
import sys
from typing import Any

from tornado.websocket import websocket_connect


async def receive(url: str, topics: list[str]) -> dict[str, Any]:
    client = await websocket_connect(url, subprotocols=["foxglove.sdk.v1"])
    result: dict[str, Any] = {"protocol": client.selected_subprotocol, "channels": {}, "messages": {}, "status": None}
    named: dict[int, str] = {}
    while len(result["messages"]) < len(topics) or result["status"] is None:
        message = await client.read_message()
        if isinstance(message, bytes):
            _, subscription, at_ns = struct.unpack_from("<BIQ", message)
            result["messages"][named[subscription]] = [at_ns, base64.b64encode(message[13:]).decode()]
            continue
        told = json.loads(message)
        if told["op"] == "serverInfo":
            result["capabilities"] = told["capabilities"]
        elif told["op"] == "advertise":
            for channel in told["channels"]:
                result["channels"][channel["topic"]] = channel
                named[channel["id"]] = channel["topic"]
            wanted = [{"id": c["id"], "channelId": c["id"]} for c in told["channels"] if c["topic"] in topics]
            await client.write_message(json.dumps({"op": "subscribe", "subscriptions": wanted}))
            command = {"id": 1, "topic": "/servo_jp", "encoding": "json", "schemaName": ""}
            await client.write_message(json.dumps({"op": "advertise", "channels": [command]}))
        elif told["op"] == "status":
            result["status"] = told["message"]
    return result


if __name__ == "__main__":
    sys.stdout.write(json.dumps(asyncio.run(receive(sys.argv[1], sys.argv[2].split(",")))))
