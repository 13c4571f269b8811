"""The panel: a page in the browser for a running stepdriver_node. Only driver.py needs ROS, and only
server.py needs aiohttp."""
