"""The panel: a page in the browser for a running stepdriver_node. panel.py and server.py need aiohttp; driver.py,
commands.py and drawing.py need ROS."""
