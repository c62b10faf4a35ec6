/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What one more drive takes of the heap, for each family: the service's own parts are made for two numbers
 * of drives on one bus, with all that a drive has from its section to its registers. What is
 * allocated and not freed is counted, with the allocator's own part of it.
 *
 * Prints a line for each family; fails when one takes more than DRIVE_MAX.
 */
#include "config/config_private.h"
#include "service/plant.h"
#include "service/service_private.h"

#include <malloc.h>
#include <stdlib.h>

#define DRIVE_MAX 9728
#define FEW 8
#define MANY 28
#define TEXT_MAX 16384

struct family {
	const char *name;
	const char *line;    /* of the bus's section */
	unsigned an_address; /* so many drives */
};

static const struct family families[] = {
	{ "vsmd-serial", "device = \"/dev/none\"", 1 },
	{ "vsmd-can", "interface = \"none\"", 1 },
	{ "servo-can", "interface = \"none\"", 1 },
	{ "xyza", "device = \"/dev/none\"", 4 },
};

/* --- the heap ---------------------------------------------------------------------------------------- */

/* The C library's own, which stand behind those below. */
void *__libc_malloc(size_t size);
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *memory, size_t size);
void __libc_free(void *memory);

static size_t in_use;

static size_t size_of(void *memory)
{
	return memory ? malloc_usable_size(memory) + sizeof(size_t) : 0;
}

void *malloc(size_t size)
{
	void *memory = __libc_malloc(size);

	in_use += size_of(memory);
	return memory;
}

void *calloc(size_t count, size_t size)
{
	void *memory = __libc_calloc(count, size);

	in_use += size_of(memory);
	return memory;
}

void *realloc(void *memory, size_t size)
{
	size_t before = size_of(memory);
	void *moved = __libc_realloc(memory, size);

	if (moved)
		in_use += size_of(moved) - before;
	return moved;
}

void free(void *memory)
{
	in_use -= size_of(memory);
	__libc_free(memory);
}

/* --- one more drive ------------------------------------------------------------------------------------ */

static void must(bool is)
{
	if (is)
		return;
	(void)fprintf(stderr, "drive_memory: something could not be made\n");
	exit(EXIT_FAILURE);
}

static db_time now(void *context)
{
	(void)context;
	return DB_NS_PER_S;
}

/* Every key but those that are needed has its default. */
static struct db_config *configured(const struct family *family, unsigned drives)
{
	static char text[TEXT_MAX];
	struct db_config *config;
	int length;

	length = snprintf(text, sizeof text, "bus l { protocol = %s\n %s\n cycle-ms = 10000 }\n",
	                  family->name, family->line);
	for (unsigned i = 0; i < drives; i++) {
		unsigned axis = i % family->an_address;

		length += snprintf(text + length, sizeof text - (size_t)length,
		                   "drive d%u { bus = l\n address = %u\n unit = %u\n", i,
		                   i / family->an_address + 1, i + 1);
		if (family->an_address > 1)
			length += snprintf(text + length, sizeof text - (size_t)length,
			                   " axis = %c\n", "xyza"[axis]);
		length += snprintf(text + length, sizeof text - (size_t)length, "}\n");
	}
	must(db_load_text(&db_load_built_in, text, "memory", stderr, &config) == 0);
	return config;
}

static size_t taken_by(const struct family *family, unsigned drives)
{
	static const struct db_registers_ops ops = { .now = now };
	size_t before = in_use;
	struct service service = { .lock = -1 };
	struct plant_roster roster;
	uint16_t number = 0;
	size_t taken;

	must(plant_new(&service, configured(family, drives), NULL, &number, &service.plant) == 0);
	must(plant_roster_init(&roster, service.plant) == 0);
	must(db_registers_new(&roster.roster, &ops, NULL, &service.registers) == 0);
	plant_roster_release(&roster);
	taken = in_use - before;
	db_registers_free(service.registers);
	plant_free(service.plant, NULL);
	return taken;
}

int main(void)
{
	bool bad = false;

	for (size_t i = 0; i < sizeof families / sizeof families[0]; i++) {
		size_t few = taken_by(&families[i], FEW);
		size_t many = taken_by(&families[i], MANY);
		size_t each = (many - few) / (MANY - FEW);

		bad = bad || each > DRIVE_MAX || each < 1024;
		printf("%-12s %6zu bytes for a drive, %.3f of %d%s\n", families[i].name, each,
		       (double)each / DRIVE_MAX, DRIVE_MAX,
		       each > DRIVE_MAX ? ": too many" :
		       each < 1024      ? ": is all of it counted?" :
		                          "");
	}
	return bad ? EXIT_FAILURE : EXIT_SUCCESS;
}
