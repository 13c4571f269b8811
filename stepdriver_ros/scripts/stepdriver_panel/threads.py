"""Calls that wait, away from the server's thread."""

import asyncio
import threading


async def in_thread(function, *arguments):
    """Calls a function that may wait for long, and returns its result. The threads don't keep the process from
    ending."""
    loop = asyncio.get_running_loop()
    future = loop.create_future()

    def conclude(conclusion, value):
        if not future.done():
            conclusion(value)

    def run():
        try:
            conclusion = (conclude, future.set_result, function(*arguments))
        except Exception as error:  # noqa: BLE001: the caller gets it
            conclusion = (conclude, future.set_exception, error)
        if not loop.is_closed():
            loop.call_soon_threadsafe(*conclusion)
    threading.Thread(target=run, daemon=True).start()
    return await future
