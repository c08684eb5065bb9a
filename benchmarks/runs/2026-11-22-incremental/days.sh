#!/bin/sh
# What one more day costs, by how many tiles it touches. Run it in an empty folder:
#   PATH=/path/to/tilefold:$PATH sh days.sh
# Takes about 10 minutes of one core, and 3 GB of disk.
set -e
city() { tilefold simulate "$1" --km 1000 --vehicles 200 --drives "$2" --drive-km "$3" --seed 5; }
city long 200 25
city short 60 0.6     # the same city and vehicles, shorter drives
city tiny 40 0.2
drives() { for i in $(seq -f %05g "$2" "$3"); do echo "$1/logs/drive_$i.mcap"; done; }

tilefold init store --map long/before.osm
tilefold run store $(drives long 0 11) --threads 1 --format json > day-100.json
day() {
    name=$1; shift
    rm -rf copy; cp -r store copy
    tilefold run copy "$@" --threads 1 --format json > "day-$name.json"
    tilefold verify copy
}
day 0.1 $(drives tiny 13 13)
day 0.3 $(drives short 12 12)
day 1 $(drives short 12 14)
day 3 $(drives short 12 21)
day 4 $(drives long 12 12)
day 10 $(drives long 12 14)
