"""Eight simulated machines and the campaigns that they record; shares no code with armid, `plants` excepted.

Read catalogue (equations), forms (undeclared effects), integrate, excite, sensors, draw, then make (the command).
"""
