"""A recording is read by packages that know nothing of this project."""

import json
from collections import Counter

from mcap.reader import make_reader


def test_the_mcap_package_reads_every_message(palpate, recording):
    info = palpate.json("info", recording.name)
    counts, sequences = Counter(), []
    with open(recording, "rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            document = json.loads(message.data)
            counts[channel.topic.removeprefix("/")] += 1
            sequences.append(document["header"]["sequence"])
            assert message.sequence == sequences[-1]
    assert counts == info["records"]
    assert len(sequences) == info["boots"][0]["received"] > 1_900
    assert sorted(sequences) == list(range(min(sequences), max(sequences) + 1))
