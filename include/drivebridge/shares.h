/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The classes of what a bus sends, and how they share its wire (docs/schedule.md): classes
 * that have something to send at the same time get wire time in proportion to their weights. Stops
 * are in no class: they go before everything, and the classes share what stops leave.
 */
#ifndef DRIVEBRIDGE_SHARES_H
#define DRIVEBRIDGE_SHARES_H

/* In the order of their precedence. */
enum db_share {
	DB_SHARE_COMMANDS, /* commands and parameter writes */
	/* status of drives that move, must stand, or were commanded within a second */
	DB_SHARE_MOVING,
	DB_SHARE_STANDING, /* status of all other drives */
	/* identity and parameters; the first probe of a drive after the port was opened */
	DB_SHARE_PARAMETERS,
	DB_SHARE_BACKGROUND, /* drives that are offline; a scan */
	DB_SHARE_COUNT,
	DB_SHARE_NONE = DB_SHARE_COUNT, /* a stop's */
};

#define DB_SHARE_BIT(share) (1U << (share))

/* How long after its last command a drive is read as often as one that moves. */
#define DB_SHARE_LIVELY_MS 1000

/*
 * Limit of what one exchange is charged, in exchanges of the usual length. A drive that loses its
 * answers pays with its own turns, but it is still asked often enough to notice that it is gone.
 */
#define DB_SHARE_LATE_TURNS 8

static inline unsigned db_share_weight(unsigned share)
{
	static const unsigned weights[DB_SHARE_COUNT] = {
		[DB_SHARE_COMMANDS] = 100,  [DB_SHARE_MOVING] = 70,    [DB_SHARE_STANDING] = 30,
		[DB_SHARE_PARAMETERS] = 15, [DB_SHARE_BACKGROUND] = 8,
	};

	return weights[share];
}

/* The sum of the weights of these classes (bits). */
static inline unsigned db_share_weights(unsigned shares)
{
	unsigned sum = 0;

	for (unsigned share = 0; share < DB_SHARE_COUNT; share++)
		sum += shares & DB_SHARE_BIT(share) ? db_share_weight(share) : 0;
	return sum;
}

/* The minimum part of the wire, 0 to 1, of a class while it and these classes (bits) have something
 * to send. */
static inline double db_share_part(enum db_share share, unsigned waiting)
{
	return (double)db_share_weight(share) / db_share_weights(waiting | DB_SHARE_BIT(share));
}

#endif
