/* SPDX-License-Identifier: Apache-2.0 */
/*
 * From one configuration to another: two texts, either the input's own or made of sections that it
 * chooses, read, compared, and carried out as a reload does as far as no thread is needed: the plant,
 * the roster, the registers with requests under way.
 *
 * What must hold: a configuration says the same as itself, and two say the same whichever is named
 * first; a plant for a text that says the same is the same plant, one for another shares exactly the
 * buses and drives that are the same; drives' numbers are each one's own; a write that waits when its
 * drive leaves is answered once.
 */
#include "config/config_private.h"
#include "drivebridge/commander.h"
#include "drivebridge/registers.h"
#include "fakes/places.h"
#include "input.h"
#include "service/service_private.h"

#define TEXT_MAX 8192
#define UNITS 4

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* --- texts ------------------------------------------------------------------------------------------ */

static void add(char text[TEXT_MAX], const char *part)
{
	size_t length = strlen(text);

	(void)snprintf(text + length, TEXT_MAX - length, "%s", part);
}

static void add_number(char text[TEXT_MAX], const char *key, unsigned number)
{
	char line[64];

	(void)snprintf(line, sizeof line, " %s = %u\n", key, number);
	add(text, line);
}

static void add_bus(char text[TEXT_MAX], unsigned bus, uint8_t choice)
{
	static const char *const heads[] = {
		"bus p { protocol = vsmd-serial\n device = \"/dev/p\"\n baud = 115200\n",
		"bus q { protocol = xyza\n device = \"/dev/q\"\n baud = 115200\n",
		"bus r { protocol = vsmd-can\n interface = \"can0\"\n",
	};

	add(text, heads[bus]);
	add_number(text, "cycle-ms", choice & 1 ? 250 : 200);
	if (choice & 2)
		add_number(text, "queue", 5);
	if (choice & 4)
		add(text, " log = warning\n");
	add(text, "}\n");
}

static void add_drive(char text[TEXT_MAX], unsigned unit, uint8_t choice)
{
	static const char *const buses[] = { "p", "q", "r" };
	char line[64];
	unsigned bus = choice % 3;

	(void)snprintf(line, sizeof line, "drive d%u {\n bus = %s\n", unit, buses[bus]);
	add(text, line);
	add_number(text, "unit", unit);
	add_number(text, "address", bus == 1 ? 1 : unit);
	if (bus == 1) {
		(void)snprintf(line, sizeof line, " axis = %c\n", "xyza"[unit - 1]);
		add(text, line);
	}
	if (choice & 0x40)
		add_number(text, "watchdog-ms", 400);
	if (choice & 0x80)
		add(text, " max-velocity = 100.0\n");
	if ((choice & 0x20) && bus != 1)
		add(text, " layout = vsmd\n");
	add(text, "}\n");
}

/* Each part is there or not, and one way or another. */
static void make_text(struct input *input, char text[TEXT_MAX])
{
	uint8_t modbus = input_u8(input);

	text[0] = '\0';
	add(text, "modbus {\n listen = \"127.0.0.1:0\"\n");
	if (modbus & 1)
		add_number(text, "max-clients", 8);
	if (modbus & 2)
		add(text, " control = drive\n");
	if (modbus & 4)
		add(text, " allow-write = {\"10.0.0.0/8\", \"127.0.0.1\"}\n");
	if (modbus & 8)
		add(text, " command-id-scope = client\n");
	add(text, "}\n");
	for (unsigned bus = 0; bus < 3; bus++)
		add_bus(text, bus, input_u8(input));
	for (unsigned unit = 1; unit <= UNITS; unit++) {
		uint8_t choice = input_u8(input);

		if (choice & 0x10)
			add_drive(text, unit, choice);
	}
}

/* The input's own words: all of them up to a NUL. */
static void take_text(struct input *input, char text[TEXT_MAX])
{
	size_t length = 0;
	uint8_t byte;

	while (length < TEXT_MAX - 1 && (byte = input_u8(input)) != 0)
		text[length++] = (char)byte;
	text[length] = '\0';
}

/* Null when the text is wrong. */
static struct db_config *read_text(const char *text)
{
	static FILE *nowhere;
	struct db_config *config = NULL;

	if (!nowhere)
		nowhere = fopen("/dev/null", "w");
	must(nowhere);
	return db_load_text(&db_load_built_in, text, "f", nowhere, &config) == 0 ? config : NULL;
}

/* --- comparing --------------------------------------------------------------------------------------- */

static bool same(const struct db_config *a, const struct db_config *b)
{
	bool modbus = db_config_same_modbus(a, b);
	bool all = modbus && a->bus_count == b->bus_count && a->drive_count == b->drive_count;

	must(modbus == db_config_same_modbus(b, a));
	for (size_t i = 0; i < a->bus_count; i++) {
		for (size_t j = 0; j < b->bus_count; j++) {
			bool bus = db_config_same_bus(&a->buses[i], &b->buses[j]);

			must(bus == db_config_same_bus(&b->buses[j], &a->buses[i]));
			all = all && (i != j || bus);
		}
	}
	for (size_t i = 0; i < a->drive_count; i++) {
		for (size_t j = 0; j < b->drive_count; j++) {
			bool drive = db_config_same_drive(a, &a->drives[i], b, &b->drives[j]);

			must(drive == db_config_same_drive(b, &b->drives[j], a, &a->drives[i]));
			all = all && (i != j || drive);
		}
	}
	return all;
}

/* --- registers with a plant --------------------------------------------------------------------------- */

#define PLACES 16

static struct {
	unsigned later;
	unsigned answered;
	uint32_t tickets[PLACES];
	struct fake_place places[PLACES];
	unsigned submitted;
} traffic;

static db_time now_of(void *context)
{
	(void)context;
	return DB_NS_PER_S;
}

static uint64_t wall_us(void *context)
{
	(void)context;
	return 1;
}

static struct db_request *submit(void *context, struct db_bus *bus,
                                 const struct db_request *request)
{
	struct db_request *kept = fake_place_fill(traffic.places, PLACES, request);

	(void)context;
	(void)bus;
	must(kept && traffic.submitted < sizeof traffic.tickets / sizeof traffic.tickets[0]);
	traffic.tickets[traffic.submitted++] = request->ticket;
	return kept;
}

static void release(void *context, struct db_request *request)
{
	(void)context;
	fake_place_release(traffic.places, PLACES, request);
}

static void answer(void *context, struct db_write_token token, uint8_t exception)
{
	(void)context;
	must(token.sequence >= 1 && token.sequence <= traffic.later && exception <= 0x0B);
	traffic.answered++;
}

static void bus_stats(void *context, struct db_bus *bus, struct db_bus_stats *stats)
{
	(void)context;
	db_bus_read_stats(bus, stats);
}

static void server_stats(void *context, struct db_server_stats *stats)
{
	(void)context;
	*stats = (struct db_server_stats){ .clients = 0 };
}

static const struct db_registers_ops ops = {
	.now = now_of,
	.wall_us = wall_us,
	.submit = submit,
	.release = release,
	.answer = answer,
	.bus_stats = bus_stats,
	.server_stats = server_stats,
};

static const struct db_client client = { .id = 1, .address = { [15] = 1 }, .may_write = true };

/* Everybody is online and is told to stop; each drive that is there takes it. */
static void command_all(struct db_registers *registers, const struct plant *plant)
{
	static const uint16_t code = DB_CMD_STOP;
	struct db_snapshot snapshot = { .feedback = { .taken = 1,
		                                      .state = DB_AXIS_STANDSTILL,
		                                      .status = DB_STATUS_ONLINE |
		                                                DB_STATUS_BUS_UP } };

	for (size_t i = 0; i < plant->drive_count; i++) {
		const struct plant_drive *drive = plant->drives[i];
		struct db_write_token token = { 1, traffic.later + 1 };

		db_axis_publish(drive->axis, &snapshot);
		if (!drive->config->vendor_layout &&
		    db_registers_backend.write(registers, &client, (uint8_t)drive->config->unit,
		                               DB_TABLE_HOLDING, 101, 1, &code,
		                               token) == DB_WRITE_LATER)
			traffic.later++;
	}
}

/* Every unit answers or says that there is nothing. */
static void read_all(struct db_registers *registers)
{
	uint16_t values[4];

	for (unsigned unit = 0; unit < 256; unit++) {
		uint8_t there = db_registers_backend.unit(registers, &client, (uint8_t)unit);
		uint8_t read = db_registers_backend.read(registers, &client, (uint8_t)unit,
		                                         DB_TABLE_HOLDING, 46, 4, values);

		must(there == 0 || (there == 0x0A && read == 0x0A));
	}
}

static void carry_out(const struct plant *from, const struct plant *to)
{
	struct db_registers_change *change;
	struct db_registers *registers;
	struct plant_roster before;
	struct plant_roster after;

	memset(&traffic, 0, sizeof traffic);
	must(plant_roster_init(&before, from) == 0);
	must(plant_roster_init(&after, to) == 0);
	must(db_registers_new(&before.roster, &ops, NULL, &registers) == 0);
	command_all(registers, from);
	must(db_registers_prepare(registers, &after.roster, &change) == 0);
	db_registers_retire(registers, change);
	read_all(registers);
	/* The first half of what was asked has its end before the drives are gone. */
	for (unsigned i = 0; i < traffic.submitted / 2; i++) {
		struct db_request *kept = fake_place_find(traffic.places, PLACES,
		                                          traffic.tickets[i]);

		must(kept);
		db_registers_complete(registers, fake_place_end(kept, DB_RESULT_OK, 0),
		                      DB_NS_PER_S);
	}
	db_registers_apply(registers, change);
	read_all(registers);
	db_registers_expire(registers, 3600 * DB_NS_PER_S);
	must(traffic.answered == traffic.later);
	db_registers_free(registers);
	plant_roster_release(&before);
	plant_roster_release(&after);
}

/* --- plants ------------------------------------------------------------------------------------------- */

static void check_numbers(const struct plant *a, const struct plant *b)
{
	for (size_t i = 0; i < a->drive_count; i++) {
		for (size_t j = 0; j < b->drive_count; j++)
			must((a->drives[i] == b->drives[j]) ==
			     (a->drives[i]->number == b->drives[j]->number));
	}
}

static void check_shared(const struct plant *running, const struct plant *next)
{
	for (size_t i = 0; i < next->bus_count; i++) {
		const struct plant_bus *before = plant_bus_named(running,
		                                                 next->buses[i]->config->name);
		bool shared = plant_has_bus(running, next->buses[i]);

		must(!shared || before == next->buses[i]);
		must(shared == (before && db_config_same_bus(before->config,
		                                             &next->edition->config->buses[i])));
	}
	for (size_t i = 0; i < next->drive_count; i++) {
		const struct plant_drive *drive = next->drives[i];

		must(plant_has_bus(next, drive->bus));
		must(!plant_has_drive(running, drive) || plant_has_bus(running, drive->bus));
	}
}

/* What a reload makes of the buses that stay, without handing it to them. */
static void make_changes(const struct plant *running, const struct plant *next)
{
	for (size_t i = 0; i < next->bus_count; i++) {
		const struct plant_bus *bus = next->buses[i];
		struct db_change *change = NULL;
		struct db_bus_drive *leaving;
		struct db_bus_drive *coming;
		uint16_t numbers[UNITS * 64];
		size_t leaving_count;
		size_t coming_count;

		if (!plant_has_bus(running, bus))
			continue;
		leaving = plant_drives_on(running, bus, next, &leaving_count);
		coming = plant_drives_on(next, bus, running, &coming_count);
		must(leaving && coming);
		for (size_t j = 0; j < leaving_count && j < UNITS * 64; j++)
			numbers[j] = leaving[j].drive;
		if (leaving_count <= UNITS * 64)
			must(db_bus_change_new(bus->bus, numbers, leaving_count, coming,
			                       coming_count, &change) == 0);
		db_bus_change_free(change);
		free(leaving);
		free(coming);
	}
}

static void go_over(struct db_config *first, struct db_config *second, bool expect_same)
{
	struct service service = { .last_number = 0 };
	struct plant *running;
	struct plant *next;
	uint16_t last = 65530; /* numbers wrap on the way */

	must(plant_new(&service, first, NULL, &last, &running) == 0);
	must(plant_new(&service, second, running, &last, &next) == 0);
	must(plant_same(running, next) == plant_same(next, running));
	must(!expect_same || plant_same(running, next));
	check_numbers(running, running);
	check_numbers(next, next);
	check_numbers(running, next);
	check_shared(running, next);
	make_changes(running, next);
	carry_out(running, next);
	plant_free(running, next);
	plant_free(next, NULL);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct input input = { data, size };
	static char first_text[TEXT_MAX];
	static char second_text[TEXT_MAX];
	bool own = input_u8(&input) & 1;
	struct db_config *first;
	struct db_config *second;

	if (size > 2 * TEXT_MAX)
		return 0;
	(own ? take_text : make_text)(&input, first_text);
	(own ? take_text : make_text)(&input, second_text);
	first = read_text(first_text);
	second = read_text(second_text);
	if (first) {
		struct db_config *again = read_text(first_text);

		must(again && same(first, first) && same(first, again));
		db_config_free(again);
	}
	if (first && second && first->drive_count <= 16 && second->drive_count <= 16) {
		go_over(first, second, same(first, second));
		return 0;
	}
	db_config_free(first);
	db_config_free(second);
	return 0;
}
