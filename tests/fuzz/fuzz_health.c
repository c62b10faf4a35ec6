/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Any bytes as the files of health: the first byte says which file they are, the list of alarms or the values (a head and then
 * a slot). They are read twice: as they are, and with right checksums.
 *
 * What must hold: what is read can be written, and is read as the same; a head never has more than the largest file; nothing that
 * is printed breaks a line of JSON.
 */
#include "health/health_private.h"

#include "fakes/must.h"

#include <jansson.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void take_alarms(const uint8_t *bytes, size_t size)
{
	struct db_alarms alarms = { 0 };
	struct db_alarms again = { 0 };
	uint8_t *written;
	size_t length;

	if (!db_alarms_read(&alarms, bytes, size)) {
		must(alarms.count == 0);
		return;
	}
	must(alarms.count <= DB_ALARMS_MAX);
	written = db_alarms_write(&alarms, &length);
	must(written && length == size);
	must(db_alarms_read(&again, written, length));
	must(again.count == alarms.count && again.last_id == alarms.last_id);
	for (size_t i = 0; i < alarms.count; i++)
		must(again.list[i].id == alarms.list[i].id &&
		     again.list[i].gone == alarms.list[i].gone);
	free(written);
	/* The list works on. */
	db_alarms_end(&alarms, 1);
	db_alarms_see(&alarms, &(struct db_alarm_seen){ .name = "drive", .detail = "" });
	must(alarms.count <= DB_ALARMS_MAX);
	db_alarms_clear(&again);
	db_alarms_clear(&alarms);
}

/* By its members: the bytes between them may have any value. */
static bool is_same(const struct db_health_value *a, const struct db_health_value *b)
{
	return a->known == b->known && a->exchanges == b->exchanges && a->retries == b->retries &&
	       a->losses == b->losses && a->damaged == b->damaged && a->mean_us == b->mean_us &&
	       a->longest_us == b->longest_us && a->offline_ms == b->offline_ms &&
	       a->coldest == b->coldest && a->hottest == b->hottest;
}

static void take_value(const uint8_t *bytes, const char *name)
{
	uint8_t written[DB_HEALTH_VALUE_BYTES];
	struct db_health_value value;
	struct db_health_value sum = { .coldest = DB_HEALTH_NO_TEMPERATURE,
		                       .hottest = DB_HEALTH_NO_TEMPERATURE };
	struct db_health_value again;
	char *text = NULL;
	size_t length;
	FILE *out;
	json_t *object;

	db_health_value_read(bytes, &value);
	db_health_value_write(&value, written);
	db_health_value_read(written, &again);
	must(is_same(&again, &value));
	db_health_value_add(&sum, &value);
	db_health_value_add(&sum, &value);
	must(!value.known || sum.mean_us == value.mean_us);
	out = open_memstream(&text, &length);
	must(out);
	db_health_value_print(&sum, name, 0, 60, out);
	must(fclose(out) == 0);
	object = json_loads(text, 0, NULL);
	must(json_is_object(object));
	json_decref(object);
	free(text);
}

static void take_values(const uint8_t *bytes, size_t size)
{
	struct db_ring_column columns[DB_RING_COLUMNS_MAX];
	struct db_ring_shape shape;
	struct db_ring_slot slot;
	uint8_t *head;

	if (!db_ring_read_head(bytes, size, &shape, columns))
		return;
	must(db_ring_file_bytes(&shape) <= DB_RING_FILE_MAX);
	head = calloc(1, db_ring_head_bytes(&shape));
	must(head);
	db_ring_write_head(&shape, columns, head);
	must(db_ring_read_head(head, db_ring_head_bytes(&shape), &shape, columns));
	free(head);
	bytes += db_ring_head_bytes(&shape);
	size -= db_ring_head_bytes(&shape);
	for (enum db_ring ring = DB_RING_MINUTES; ring < DB_RING_COUNT; ring++) {
		if (size < db_ring_slot_bytes(&shape) ||
		    !db_ring_read_slot(&shape, ring, bytes, &slot))
			continue;
		must(db_ring_place(&shape, ring, slot.number) + db_ring_slot_bytes(&shape) <=
		     db_ring_file_bytes(&shape));
		for (size_t i = 0; i < shape.columns; i++)
			take_value(bytes + DB_RING_SLOT_HEAD + i * DB_HEALTH_VALUE_BYTES,
			           columns[i].name);
	}
}

/* As the files would have them, where there is room for them. */
static void put_checksums(uint8_t *bytes, size_t size, bool alarms)
{
	size_t columns = size > 12 ? db_bytes_get(bytes + 10, 2) : 0;
	struct db_ring_shape shape = { .columns = (uint16_t)columns };
	size_t head = db_ring_head_bytes(&shape);

	if (alarms) {
		if (size > 16)
			db_bytes_put(bytes + 12, db_bytes_crc(bytes + 16, size - 16), 4);
		return;
	}
	if (size < head || columns > DB_RING_COLUMNS_MAX)
		return;
	memset(bytes + 18, 0, 4);
	db_bytes_put(bytes + 18, db_bytes_crc(bytes, head), 4);
	if (size - head >= db_ring_slot_bytes(&shape))
		db_bytes_put(bytes + head,
		             db_bytes_crc(bytes + head + 4, db_ring_slot_bytes(&shape) - 4), 4);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	uint8_t *bytes;
	bool alarms;

	if (size == 0)
		return 0;
	alarms = data[0] % 2 == 0;
	size--;
	/* A block of exactly this size: reading behind it is found. */
	bytes = malloc(size > 0 ? size : 1);
	must(bytes);
	memcpy(bytes, data + 1, size);
	for (unsigned i = 0; i < 2; i++) {
		if (alarms)
			take_alarms(bytes, size);
		else
			take_values(bytes, size);
		put_checksums(bytes, size, alarms);
	}
	free(bytes);
	return 0;
}
