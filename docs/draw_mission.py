#!/usr/bin/env python3
"""Draws a recorded mission from above, as SVG: python docs/draw_mission.py mission.mcap > forest.svg

Needs the packages of tests/python/requirements.txt.
"""
import math
import sys

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

# Okabe and Ito's colours, which the colour-blind tell apart.
COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8C6D1F", "#4D4D4D"]
SCALE = 14.0
MARGIN_M = 3.0


def read(path):
    """Trunks as (x, y, radius), and each vehicle's positions by time in seconds."""
    trunks, ways = [], {}
    with open(path, "rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            if channel.topic == "/scene":
                for entity in decoded.entities:
                    for cylinder in entity.cylinders:
                        centre = cylinder.pose.position
                        trunks.append((centre.x, centre.y, cylinder.size.x / 2))
            elif channel.topic.endswith("/pose"):
                place = decoded.pose.position
                way = ways.setdefault(channel.topic.split("/")[2], [])
                way.append((message.log_time / 1e9, place.x, place.y))
    return trunks, ways


def draw(trunks, ways):
    """The SVG, line by line. North is up."""
    places = [(x, y) for way in ways.values() for _, x, y in way] + [(x, y) for x, y, _ in trunks]
    west, east = (f(x for x, _ in places) for f in (min, max))
    south, north = (f(y for _, y in places) for f in (min, max))
    west, south, east, north = west - MARGIN_M, south - MARGIN_M, east + MARGIN_M, north + MARGIN_M
    width, height = (east - west) * SCALE, (north - south) * SCALE

    def at(x, y):
        return f"{(x - west) * SCALE:.1f}", f"{(north - y) * SCALE:.1f}"

    yield f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" font-family="sans-serif">'
    yield f'<rect width="{width:.0f}" height="{height:.0f}" rx="10" fill="#F7F7F2"/>'
    for x, y, radius in trunks:
        cx, cy = at(x, y)
        yield f'<circle cx="{cx}" cy="{cy}" r="{radius * SCALE:.1f}" fill="#B9B4A4"/>'
    for (name, way), colour in zip(sorted(ways.items(), key=lambda item: int(item[0])), COLOURS * 32):
        line, last = [], None
        for _, x, y in way:
            if last is None or math.dist(last, (x, y)) > 0.2:
                line.append(" ".join(at(x, y)))
                last = (x, y)
        yield f'<polyline points="{", ".join(line)}" fill="none" stroke="{colour}" stroke-width="3" stroke-linejoin="round" opacity="0.9"/>'
        (sx, sy), (gx, gy) = at(*way[0][1:]), at(*way[-1][1:])
        yield f'<circle cx="{sx}" cy="{sy}" r="5" fill="white" stroke="{colour}" stroke-width="3"/>'
        yield f'<circle cx="{gx}" cy="{gy}" r="8" fill="{colour}"/>'
        yield f'<text x="{float(gx) + 13:.1f}" y="{float(gy) + 5:.1f}" font-size="15" fill="#333">{name}</text>'
        yield f'<text x="{float(sx) - 22:.1f}" y="{float(sy) + 5:.1f}" font-size="15" fill="#333">{name}</text>'
    yield "</svg>"


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    print("\n".join(draw(*read(sys.argv[1]))))
