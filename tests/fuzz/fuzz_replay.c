/* SPDX-License-Identifier: Apache-2.0 */
/* A trace to be replayed, whatever is in the file, and whatever is asked then: the first byte says how long the file is. */
#include "fakes/must.h"
#include "sim/replay.h"

#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void ask(struct sim_replay *replay, const uint8_t *data, size_t size)
{
	uint8_t out[64];
	db_time now = 0;
	size_t count = 0;

	while (size > 0) {
		size_t part = 1 + data[0] % 16;

		part = part < size ? part : size;
		sim_replay_ops.receive(replay, data, part, now);
		data += part;
		size -= part;
		now += 20 * DB_NS_PER_MS;
		while ((count = sim_replay_ops.run(replay, now, out, sizeof out)) > 0)
			must(count <= sizeof out);
	}
	while (sim_replay_ops.next(replay) != DB_TIME_NEVER) {
		now = sim_replay_ops.next(replay);
		must(sim_replay_ops.run(replay, now, out, sizeof out) > 0);
	}
	(void)sim_replay_is_complete(replay);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	static FILE *nowhere;
	struct sim_replay *replay;
	size_t length;
	char *text;

	if (!nowhere)
		nowhere = fopen("/dev/null", "we");
	must(nowhere);
	if (size == 0)
		return 0;
	length = (size_t)data[0] * 8 < size - 1 ? (size_t)data[0] * 8 : size - 1;
	text = strndup((const char *)data + 1, length);
	must(text);
	replay = sim_replay_parse(text, "f", nowhere);
	if (replay)
		ask(replay, data + 1 + length, size - 1 - length);
	sim_replay_free(replay);
	free(text);
	return 0;
}
