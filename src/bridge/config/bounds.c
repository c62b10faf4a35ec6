/* SPDX-License-Identifier: Apache-2.0 */
#include "config/bounds.h"

#include "drivebridge/driver.h"
#include "drivebridge/shares.h"

/* Work handed to a CAN bus ahead, see src/bridge/sched/exchange.c. */
#define CAN_AHEAD (1 * DB_NS_PER_MS)

/* The largest values to which a gap and the time-out of answers are learnt, see
 * src/bridge/sched/learn.h. */
#define LEARNT_GAP (8 * DB_NS_PER_MS)
#define LEARNT_PATIENCE (78 * DB_NS_PER_MS)

static db_time as_learnt(const struct db_bus_config *bus, db_time begin, db_time most)
{
	return bus->adapt && most > begin ? most : begin;
}

/* A drive is due once in a cycle, and then waits for its turn: `wire` is what its class takes of
 * the wire, of which it has this part. Where its class alone keeps the wire busy, it is already due
 * when its turn comes. */
static db_time between_samples(db_time cycle, db_time wire, double part, bool busy)
{
	db_time turn = (db_time)((double)wire / part);

	if (busy)
		return cycle + turn;
	return cycle > turn ? cycle : turn;
}

void db_bounds_of(const struct db_bus_config *bus, const struct db_load_of_bus *load,
                  struct db_bounds *bounds)
{
	const struct db_driver *driver = bus->driver;
	bool can = driver->medium == DB_MEDIUM_CAN;
	db_time cycle = (db_time)bus->cycle_ms * DB_NS_PER_MS;
	db_time round = db_driver_round_time(bus, load->nodes, load->drives);
	db_time node = load->nodes > 0 ? round / (db_time)load->nodes : driver->poll_time(bus);
	size_t stand = load->nodes - load->moving;
	unsigned others = load->busy ? (1U << DB_SHARE_COUNT) - 1 : 0;
	double moving = db_share_part(DB_SHARE_MOVING,
	                              others | (stand > 0 ? DB_SHARE_BIT(DB_SHARE_STANDING) : 0));
	double standing = db_share_part(DB_SHARE_STANDING, others);

	*bounds = (struct db_bounds){ 0 };
	bounds->exchange = db_driver_brief_time(bus);
	if (bounds->exchange < db_driver_own_time(bus))
		bounds->exchange = db_driver_own_time(bus);
	bounds->stop = can ? CAN_AHEAD + bounds->exchange : bounds->exchange;
	/*
	 * The drive may just have answered, and does not receive during its gap; the same is true
	 * of a drive that could take the end of the stop for its own, and of one that still drives
	 * the line. These waits run at the same time, because nothing else is begun meanwhile.
	 */
	bounds->hearing = can ? 0 :
	                        as_learnt(bus, (db_time)bus->turnaround_us * DB_NS_PER_US,
	                                  LEARNT_GAP);
	bounds->unanswered = can ? 0 :
	                           as_learnt(bus, (db_time)bus->drive_latency_ms * DB_NS_PER_MS,
	                                     LEARNT_PATIENCE);
	bounds->parameter = bounds->exchange + driver->command_time(bus);
	if (load->moving > 0)
		bounds->moving = between_samples(cycle, (db_time)load->moving * node, moving,
		                                 load->busy) +
		                 bounds->exchange;
	if (stand == 0)
		return;
	/* The part that moving drives do not use is left to the standing ones. */
	if (!load->busy) {
		double used = (double)load->moving * (double)node / (double)cycle;

		standing = 1.0 - (used < moving ? used : moving);
	}
	bounds->standing = between_samples(cycle, (db_time)stand * node, standing, load->busy) +
	                   bounds->exchange;
}
