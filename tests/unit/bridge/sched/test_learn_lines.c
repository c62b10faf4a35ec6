/* SPDX-License-Identifier: Apache-2.0 */
/* What is learnt of the times of simulated drives on CAN, and what a scan does to what is learnt on a serial line. */
#include "fakes/rs485.h"
#include "sched/scan.h"
#include "stop_world.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#define US DB_NS_PER_US

/* --- CAN ------------------------------------------------------------------------------------------ */

/* The first drive answers so late. */
struct late_world {
	struct world world;
	db_time late;
};

static bool on_answer(void *context, size_t drive, const uint8_t *bytes, size_t length)
{
	struct late_world *late = context;

	if (drive != 0 || late->late == 0)
		return true;
	world_delay(&late->world, false, bytes, length, late->late);
	return false;
}

static struct late_world *open_late(enum family family, db_time time)
{
	struct late_world *late = calloc(1, sizeof *late);

	assert_non_null(late);
	world_open(&late->world, family, 0);
	late->world.context = late;
	late->world.on_answer = on_answer;
	late->late = time;
	return late;
}

static void close_late(struct late_world *late)
{
	world_close(&late->world);
	free(late);
}

static enum db_result do_command(struct world *world, enum db_command command)
{
	struct world_ticket *ticket = world_post(world, 0, command);

	world_wait(world);
	return ticket->result;
}

static void a_late_drive_on_can_is_waited_for(enum family family, db_time late_by)
{
	struct late_world *late = open_late(family, late_by);
	struct world *world = &late->world;
	struct fake_bus *bus = world->bus;
	unsigned timeouts;

	world_set_port(world, true);
	fake_pass(bus, 5000 * MS);
	assert_true(fake_is_online(bus, 0));
	assert_true(fake_snapshot(bus, 0).learnt.latency_ms * MS > late_by);
	assert_int_equal(fake_snapshot(bus, 0).learnt.gap_us, 0);
	assert_int_equal(fake_snapshot(bus, 1).learnt.latency_ms, 0);
	/* What it needs is known: it loses nothing, and is obeyed at once. */
	timeouts = fake_snapshot(bus, 0).stats.timeouts;
	assert_int_equal(do_command(world, DB_CMD_ENABLE), DB_RESULT_OK);
	assert_int_equal(do_command(world, DB_CMD_MOVE_VELOCITY), DB_RESULT_OK);
	fake_pass(bus, 1000 * MS);
	assert_true(world_moves(world, 0));
	assert_int_equal(do_command(world, DB_CMD_STOP), DB_RESULT_OK);
	fake_pass(bus, 1000 * MS);
	assert_false(world_moves(world, 0));
	assert_int_equal(fake_snapshot(bus, 0).stats.timeouts, timeouts);
	close_late(late);
}

static void late_drives_on_can_are_waited_for(void **state)
{
	(void)state;
	for (db_time late = 24 * MS; late <= 56 * MS; late += 8 * MS) {
		a_late_drive_on_can_is_waited_for(FAMILY_VSMD_CAN, late);
		a_late_drive_on_can_is_waited_for(FAMILY_SERVO, late);
	}
}

/* By a tenth a minute, when it has not been as late for five to ten. */
static void patience_on_can_comes_down_again(void **state)
{
	struct late_world *late = open_late(FAMILY_VSMD_CAN, 40 * MS);
	struct fake_bus *bus = late->world.bus;

	(void)state;
	world_set_port(&late->world, true);
	fake_pass(bus, 5000 * MS);
	assert_true(fake_snapshot(bus, 0).learnt.latency_ms > 50);
	late->late = 0;
	fake_pass(bus, 12 * 60 * DB_NS_PER_S);
	assert_true(fake_snapshot(bus, 0).learnt.latency_ms < 50);
	close_late(late);
}

/* --- a scan beside it --------------------------------------------------------------------------------- */

/* It asks the addresses of the drives as well, and others that nobody has. */
static void a_scan_does_not_keep_a_line_from_learning(void **state)
{
	static const unsigned four[] = { 3, 4, 5, 6, 0 };
	static const struct db_scan_plan plan = { .first = 1, .last = 8 };

	(void)state;
	for (db_time deaf = 0; deaf <= 8 * MS; deaf += 2 * MS) {
		struct rs485 *line = rs485_new(four);
		unsigned scans = 0;
		struct db_snapshot snapshot;

		line->bus->config.cycle_ms = 100;
		line->nodes[1].deaf = deaf;
		rs485_begin(line);
		for (unsigned i = 0; i < 10; i++) {
			struct scan *scan = scan_new(&line->bus->config, &plan, 1);
			struct db_scan_progress progress;

			assert_non_null(scan);
			scan_begin(line->bus->engine, scan, line->bus->now);
			fake_pass(line->bus, 4000 * MS);
			db_seqlock_read(&scan->sequence, scan->words, &progress, sizeof(progress));
			if (atomic_load(&scan->ended)) {
				assert_int_equal(progress.end, DB_SCAN_DONE);
				assert_int_equal(progress.finds, 4);
				scans++;
			} else {
				scan_end(line->bus->engine, DB_SCAN_CANCELLED);
			}
			scan_free(scan);
		}
		assert_true(scans > 5);
		snapshot = fake_snapshot(line->bus, 1);
		assert_true(fake_is_online(line->bus, 1));
		assert_true(deaf <= 1 * MS || snapshot.learnt.gap_us * US >= deaf);
		/* Its silence after a question of the scan is not taken for deafness. */
		assert_true(deaf > 1 * MS || snapshot.learnt.gap_us <= 1000);
		assert_int_equal(line->told[DB_EVENT_DRIVE_DEAF] > 0, deaf > 1 * MS);
		rs485_free(line);
	}
}

static int free_configs(void **state)
{
	(void)state;
	world_free_configs();
	return 0;
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(late_drives_on_can_are_waited_for),
		cmocka_unit_test(patience_on_can_comes_down_again),
		cmocka_unit_test(a_scan_does_not_keep_a_line_from_learning),
	};

	return cmocka_run_group_tests_name("learning on lines", tests, NULL, free_configs);
}
