/* SPDX-License-Identifier: Apache-2.0 */
#include "driver/vsmd/vsmd_private.h"

#include "fakes/nameplate.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#define SPD_BIT (UINT64_C(1) << VSMD_SPD)
#define MCS_BIT (UINT64_C(1) << VSMD_MCS)

/* A drive that was read once, with spd 1 and mcs 2. */
static void read_first(struct vsmd_memory *memory, struct db_nameplate *plate,
                       struct db_nameplate_copy *room)
{
	*memory = (struct vsmd_memory){ .unsaved = false };
	*plate = fake_nameplate(room, SPD_BIT | MCS_BIT);
	plate->values[VSMD_SPD].u = 1;
	plate->values[VSMD_MCS].u = 2;
	vsmd_memory_follow(memory, plate, true);
	assert_false(memory->unsaved);
}

static void write_speed(struct vsmd_memory *memory, struct db_nameplate *plate, uint32_t speed)
{
	plate->values[VSMD_SPD].u = speed;
	vsmd_memory_follow(memory, plate, false);
}

static void test_what_is_written_is_unsaved_until_it_is_saved(void **state)
{
	struct vsmd_memory memory;
	struct db_nameplate_copy room;
	struct db_nameplate plate;

	(void)state;
	read_first(&memory, &plate, &room);
	write_speed(&memory, &plate, 7);
	assert_true(memory.unsaved);
	vsmd_memory_follow(&memory, &plate, true);
	assert_true(memory.unsaved);
	vsmd_memory_keep(&memory, &plate);
	assert_false(memory.unsaved);
	write_speed(&memory, &plate, 1);
	assert_true(memory.unsaved);
	write_speed(&memory, &plate, 7);
	assert_false(memory.unsaved);
}

static void test_what_was_written_before_all_was_read_is_no_baseline(void **state)
{
	struct vsmd_memory memory = { .unsaved = false };
	struct db_nameplate_copy room;
	struct db_nameplate plate = fake_nameplate(&room, SPD_BIT);

	(void)state;
	write_speed(&memory, &plate, 7);
	assert_false(memory.unsaved);
	assert_int_equal(memory.kept.valid, 0);
}

static void test_a_restart_gives_back_what_was_kept(void **state)
{
	struct vsmd_memory memory;
	struct db_nameplate_copy room;
	struct db_nameplate plate;

	(void)state;
	read_first(&memory, &plate, &room);
	write_speed(&memory, &plate, 7);
	memory.restarted = true;
	plate.values[VSMD_SPD].u = 1;
	vsmd_memory_follow(&memory, &plate, true);
	assert_false(memory.unsaved);
	assert_false(memory.restarted);
	/* It had something else in its memory than what was found first. */
	memory.restarted = true;
	plate.values[VSMD_MCS].u = 5;
	vsmd_memory_follow(&memory, &plate, true);
	assert_false(memory.unsaved);
	write_speed(&memory, &plate, 7);
	write_speed(&memory, &plate, 1);
	assert_false(memory.unsaved);
}

static void test_one_that_only_looked_restarted_still_has_to_be_saved(void **state)
{
	struct vsmd_memory memory;
	struct db_nameplate_copy room;
	struct db_nameplate plate;

	(void)state;
	read_first(&memory, &plate, &room);
	write_speed(&memory, &plate, 7);
	memory.restarted = true;
	vsmd_memory_follow(&memory, &plate, true);
	assert_true(memory.unsaved);
	/* A restart that was not noticed: it has again what was kept. */
	plate.values[VSMD_SPD].u = 1;
	vsmd_memory_follow(&memory, &plate, true);
	assert_false(memory.unsaved);
}

static void test_what_is_not_told_is_not_compared(void **state)
{
	struct vsmd_memory memory;
	struct db_nameplate_copy room;
	struct db_nameplate plate;

	(void)state;
	read_first(&memory, &plate, &room);
	plate.valid[0] = MCS_BIT;
	plate.values[VSMD_SPD].u = 9;
	vsmd_memory_follow(&memory, &plate, true);
	assert_false(memory.unsaved);
	plate.valid[0] |= UINT64_C(1) << VSMD_CAF;
	plate.values[VSMD_CAF].u = 9;
	vsmd_memory_follow(&memory, &plate, true);
	assert_false(memory.unsaved);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_what_is_written_is_unsaved_until_it_is_saved),
		cmocka_unit_test(test_what_was_written_before_all_was_read_is_no_baseline),
		cmocka_unit_test(test_a_restart_gives_back_what_was_kept),
		cmocka_unit_test(test_one_that_only_looked_restarted_still_has_to_be_saved),
		cmocka_unit_test(test_what_is_not_told_is_not_compared),
	};

	return cmocka_run_group_tests_name("driver: what a VSMD drive keeps", tests, NULL, NULL);
}
